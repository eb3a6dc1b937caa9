"""Protocols of a robot arm and its motions, and the inputs of motion planning: goal and task."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from executive.cell.objects import ObjectClass, Obstacle
from executive.geometry import Array, Pose


class Motion(Protocol):
    """A planned, collision-checked arm trajectory from rest to rest."""

    @property
    def duration(self) -> float:
        """Time from the start of the motion to rest at its end [s]."""


@dataclass(frozen=True)
class Goal:
    """Pose at which the tool comes to rest, pointing down.

    Attributes:
        position: Position of the tool centre point `(x, y, z)` [m].
        yaws: Permitted rotations of the tool about the vertical axis [rad]; the planner chooses the fastest.
            If empty, every rotation is permitted.
        guarded_length: Length of the guarded descent [m]; 0: no guarded descent. The guarded descent is the
            end of the motion, during which the tool may touch the target.
        guarded_speed: Maximum tool speed of the slow end of the guarded descent [m/s].
        fast_length: Length of the beginning of the guarded descent, in which the arm still brakes [m]; the
            remaining, slow end is vertical.
    """

    position: tuple[float, float, float]
    yaws: tuple[float, ...] = ()
    guarded_length: float = 0.0
    guarded_speed: float = math.inf
    fast_length: float = 0.0

    @property
    def slow_length(self) -> float:
        """Length of the slow, vertical end of the motion [m]."""
        return self.guarded_length - self.fast_length


@dataclass(frozen=True)
class Task:
    """Load and obstacles with which a motion is planned.

    Attributes:
        load: Class of the object in the tool, or None.
        holding_force: Maximum force with which the tool holds the load [N].
        obstacles: Obstacles that are not in the cell file: objects on the table and in the bins.
        target: Obstacle that the tool may touch during the guarded descent, or None.
    """

    load: ObjectClass | None = None
    holding_force: float = math.inf
    obstacles: tuple[Obstacle, ...] = ()
    target: Obstacle | None = None


class Planning(Protocol):
    """Running or finished planning of a motion."""

    @property
    def ready(self) -> bool:
        """True once planning has finished, with a motion or with an error that `result` raises."""

    def result(self) -> Motion:
        """Return the planned motion; only allowed while `ready` is True.

        Raises:
            Unreachable: No joint configuration within the limits reaches the goal.
            Blocked: Every path comes too close to an obstacle.
        """


class Arm(Protocol):
    """A robot arm that follows planned motions."""

    @property
    def q(self) -> Array:
        """Measured joint positions `(n,)` [rad]."""

    @property
    def tool_pose(self) -> Pose:
        """Pose `X_WT` of the tool centre point in the world; the z axis points out of the tool."""

    @property
    def tool_velocity(self) -> Array:
        """Velocity of the tool centre point in the world `(3,)` [m/s]."""

    @property
    def destination(self) -> Array:
        """Tool position `(3,)` [m] at the end of the current motion; at rest, the current position."""

    @property
    def at_rest(self) -> bool:
        """True while the arm neither follows a motion nor brakes."""

    @property
    def collision(self) -> str | None:
        """Description of the collision that ended the last motion, or None."""

    @property
    def contact_point(self) -> Sequence[float] | None:
        """Point `(x, y, z)` [m] at which the last motion collided; None: unknown, or no collision."""

    def describe_unreachable(self, goal: Goal) -> str:
        """Return a sentence if no joint configuration within the limits reaches a goal, else ""."""

    def plan(self, goal: Goal | str, task: Task = Task()) -> Planning:
        """Start to plan a motion from the current position to a goal, or to a named pose of the cell file.

        The motion is available at once if an earlier call of `plan_ahead` with equal arguments has planned a
        motion from the current position.
        """

    def plan_ahead(self, goal: Goal | str, task: Task = Task()) -> None:
        """Plan a motion from the end of the current motion, for a later call of `plan`."""

    def start(self, motion: Motion) -> None:
        """Start to follow `motion`; the arm must be at rest at the start position of `motion`."""

    def stop(self) -> None:
        """Start to brake along the path of the current motion, if any; return at once."""
