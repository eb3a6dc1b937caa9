"""Protocol of the arm, and the goals, tasks and motions that it plans and follows."""

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
        """Time from the start to the final rest [s]."""


@dataclass(frozen=True)
class Goal:
    """Pose at which the tool comes to rest, pointing down.

    Attributes:
        position: Position of the tool centre point `(x, y, z)` [m].
        yaw: Rotation about the vertical [rad], or None for any rotation.
        guarded: Length of the guarded last part, straight down [m]; 0 for none.
        speed: Largest tool speed of the guarded part [m/s].
    """

    position: tuple[float, float, float]
    yaw: float | None = None
    guarded: float = 0.0
    speed: float = math.inf


@dataclass(frozen=True)
class Task:
    """Load and obstacles of a motion.

    Attributes:
        load: Object in the tool, or None.
        around: Obstacles that the cell file does not declare: objects on the table and in the bins.
        target: Obstacle that the tool may touch on the guarded part only, or None.
    """

    load: Load | None = None
    around: tuple[Obstacle, ...] = ()
    target: Obstacle | None = None


class Planning(Protocol):
    """Planning of a motion, in progress or finished."""

    @property
    def ready(self) -> bool:
        """True from the control step in which the planning is finished."""

    def result(self) -> Motion:
        """Return the motion, once `ready` is True.

        Raises:
            Unreachable: The goal has no joint solution inside the limits.
            Blocked: Every path comes too close to an obstacle.
        """


class Arm(Protocol):
    """A robot arm that follows planned motions."""

    @property
    def q(self) -> Array:
        """Measured joint positions `(n,)` [rad]."""

    @property
    def tool_pose(self) -> Pose:
        """Pose `X_WT` of the tool centre point, from the joint positions; z points out of the tool."""

    @property
    def tool_velocity(self) -> Array:
        """Velocity of the tool centre point in the world `(3,)` [m/s]."""

    @property
    def destination(self) -> Array:
        """Position of the tool `(3,)` [m] at the end of the present motion, or now if there is none."""

    @property
    def at_rest(self) -> bool:
        """True while the arm neither follows a motion nor brakes."""

    @property
    def collision(self) -> str | None:
        """Description of the collision that ended the last motion, or None."""

    def plan(self, goal: Goal | str, task: Task = Task()) -> Planning:
        """Begin to plan a motion from the present position to a goal, or to a named pose of the cell file.

        The planning is finished at once if `plan_ahead` had the same arguments and the same start.
        """

    def plan_ahead(self, goal: Goal | str, task: Task = Task()) -> None:
        """Plan a motion from the end of the present motion, for a later call of `plan`."""

    def start(self, motion: Motion) -> None:
        """Begin to follow `motion`; the arm must be at rest at the start of `motion`."""

    def stop(self) -> None:
        """Brake along the path of the present motion, if any; return at once."""


def refuse_steps(motion: object) -> None:
    """Check that a motion is not a generator whose caller forgot `yield from`.

    Raises:
        Fault: The motion is a generator.
    """
    if isinstance(motion, GeneratorType):
        raise Fault(
            f"the generator {motion.__name__}(...) was passed to the arm where a motion is expected: "
            f'"yield from" is missing. Write "motion = yield from {motion.__name__}(...)"'
        )
