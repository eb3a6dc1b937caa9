"""The arm as a skill sees it: a goal, and what to heed on the way, become a motion planned and checked."""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import GeneratorType
from typing import Protocol

from executive.cell.objects import Load, Obstacle
from executive.errors import Fault
from executive.geometry import Array, Pose


class Motion(Protocol):
    """A planned and checked arm trajectory, at rest at both ends."""

    @property
    def duration(self) -> float:
        """Time it takes from start to rest [s]."""


@dataclass(frozen=True)
class Goal:
    """Where the tool is to come to rest, pointing down.

    Attributes:
        position: Of the tool centre point `(x, y, z)` [m].
        yaw: Rotation about the vertical [rad], or None where it is free.
        guarded: Length of the last part, straight down and no faster than `speed` [m]; 0 for none.
        speed: Tool speed of that part [m/s].
    """

    position: tuple[float, float, float]
    yaw: float | None = None
    guarded: float = 0.0
    speed: float = math.inf


@dataclass(frozen=True)
class Task:
    """What a motion has to heed on its way.

    Attributes:
        load: What the tool holds, or None.
        around: What stands in the cell beyond what its file says.
        target: What the tool is to touch on the guarded part, and stays away from before that, or None.
    """

    load: Load | None = None
    around: tuple[Obstacle, ...] = ()
    target: Obstacle | None = None


class Planning(Protocol):
    """A motion being planned."""

    @property
    def ready(self) -> bool:
        """True from the tick at which it is known, on the run's clock."""

    def result(self) -> Motion:
        """Return the motion.

        Raises:
            Unreachable: The goal has no joint solution inside the limits.
            Blocked: Every way comes too close to something.
        """


class Arm(Protocol):
    """A robot arm that follows planned motions."""

    @property
    def q(self) -> Array:
        """Measured joint positions `(n,)` [rad]."""

    @property
    def tool_pose(self) -> Pose:
        """Pose of the tool centre point in the world, from the joint positions."""

    @property
    def tool_velocity(self) -> Array:
        """Velocity of the tool centre point in the world `(3,)` [m/s]."""

    @property
    def destination(self) -> Array:
        """Where the tool will be when the running motion is over, or is now `(3,)` [m]."""

    @property
    def at_rest(self) -> bool:
        """True while no motion runs and no braking is under way."""

    @property
    def met(self) -> str | None:
        """What the arm ran into in its last motion, which it then broke off, or None."""

    def plan(self, goal: Goal | str, task: Task = Task()) -> Planning:
        """Begin to plan a motion from where the arm rests to a goal, or to a named pose of the cell file.

        What `plan_ahead` was asked before, in the same words and for the same start, is known at once.
        """

    def plan_ahead(self, goal: Goal | str, task: Task = Task()) -> None:
        """Plan a motion, from where the running one will end, before anybody asks for it."""

    def start(self, motion: Motion) -> None:
        """Begin to follow `motion`; the arm must be at rest where it starts."""

    def stop(self) -> None:
        """Brake along the running motion's path; returns at once, also when nothing runs."""


def refuse_steps(motion: object) -> None:
    """Return unless what an arm is to follow are the steps that would plan a motion, none of them made.

    Raises:
        Fault: They are.
    """
    if isinstance(motion, GeneratorType):
        raise Fault(
            f"the generator {motion.__name__}(...) was passed to the arm where a motion is expected: "
            f'"yield from" is missing. Write "motion = yield from {motion.__name__}(...)"'
        )
