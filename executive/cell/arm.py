"""Protocols of a robot arm and its motions, and the inputs of motion planning: goal and task."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from executive.cell.objects import ObjectClass, Obstacle
from executive.geometry import Array, Pose


class JointState(NamedTuple):
    """Position [rad], velocity [rad/s] and acceleration [rad/s²] of `n` joints, each `(n,)` or `(N, n)`."""

    q: Array
    qd: Array
    qdd: Array

    @staticmethod
    def at_rest(q: Array) -> JointState:
        """Return the state of rest at `q` `(n,)` [rad]."""
        return JointState(q, np.zeros(len(q)), np.zeros(len(q)))


class Motion(Protocol):
    """A planned, collision-checked trajectory of an arm with `n` joints, at rest at both ends."""

    @property
    def duration(self) -> float:
        """Time from the start of the motion to rest at its end [s]."""

    @property
    def guarded_start_time(self) -> float:
        """Time from which the tool may touch the target [s]; infinite for no contact."""

    def state_at(self, time: float) -> JointState:
        """Return the joint state `(n,)` at `time` [s]; at rest before time 0 and after `duration`."""


class MotionGuard(NamedTuple):
    """Events at which an arm stops along the path of its motion, beside collisions.

    Attributes:
        touch: The tool touches something that it did not touch at the start of the motion; if it holds an
            object, this object does, during the guarded descent.
        lost_grip: The tool no longer holds anything.
        push_force: Maximum force at a point of the tool in the guarded part that is no collision [N].
    """

    touch: bool = False
    lost_grip: bool = False
    push_force: float = 0.0


@dataclass(frozen=True)
class Goal:
    """Pose at which the tool comes to rest, pointing down.

    Attributes:
        position: Position of the tool centre point `(x, y, z)` [m].
        yaws: Permitted rotations of the tool about the vertical axis [rad]; the planner chooses the fastest.
            If empty, every rotation is permitted.
        guarded_length: Length of the guarded part, usually a descent [m]; 0: no guarded part. It is the end
            of the motion, during which the tool may touch the target.
        guarded_speed: Maximum tool speed of the slow end of the guarded part [m/s].
        fast_length: Length of the beginning of a guarded descent, in which the arm still brakes [m]; the
            remaining, slow end is straight.
        direction: Unit vector of the straight end of the motion; by default straight down.
    """

    position: tuple[float, float, float]
    yaws: tuple[float, ...] = ()
    guarded_length: float = 0.0
    guarded_speed: float = math.inf
    fast_length: float = 0.0
    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)

    @property
    def slow_length(self) -> float:
        """Length of the slow, straight end of the motion [m]."""
        return self.guarded_length - self.fast_length

    def compute_line_start(self, length: float) -> tuple[float, float, float]:
        """Return the position [m] from which a straight line of a length [m] leads to the goal."""
        start = np.array(self.position) - length * np.array(self.direction)
        return (float(start[0]), float(start[1]), float(start[2]))


@dataclass(frozen=True)
class Task:
    """Load and obstacles with which a motion is planned.

    Attributes:
        load: Class of the object in the tool, or None.
        holding_force: Maximum force with which the tool holds the load [N].
        obstacles: Obstacles that are not in the cell file: objects on the table and in the bins.
        target: Obstacle that the tool may touch during the guarded descent, or None.
        opening: Distance between the fingers of the tool during the motion [m]; 0: fully open, or no fingers.
    """

    load: ObjectClass | None = None
    holding_force: float = math.inf
    obstacles: tuple[Obstacle, ...] = ()
    target: Obstacle | None = None
    opening: float = 0.0


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


class MovingArm(Protocol):
    """State of the motion of an arm, and its stop: what the arm of a driver and the arm of skills share."""

    @property
    def at_rest(self) -> bool:
        """True while the arm neither follows a motion nor brakes."""

    @property
    def collision(self) -> str | None:
        """Description of the collision that ended the last motion, or None."""

    @property
    def contact_point(self) -> Sequence[float] | None:
        """Point `(x, y, z)` [m] at which the last motion collided; None: unknown, or no collision."""

    def stop(self) -> None:
        """Start to brake along the path of the current motion, if any; return at once."""


class Arm(MovingArm, Protocol):
    """A robot arm that plans and follows motions, as skills see it."""

    @property
    def tool_pose(self) -> Pose:
        """Pose `X_WT` of the tool centre point in the world; the z axis points out of the tool."""

    @property
    def tool_velocity(self) -> Array:
        """Velocity of the tool centre point in the world `(3,)` [m/s]."""

    @property
    def destination(self) -> Array:
        """Tool position `(3,)` [m] at the end of the current motion; at rest, the current position."""

    def describe_unreachable(self, goal: Goal) -> str:
        """Return a sentence if no joint configuration within the limits reaches a goal, else ""."""

    def plan(self, goal: Goal | str, task: Task = Task()) -> Planning:
        """Start to plan a motion from the current position to a goal, or to a named pose of the cell file.

        The motion is available at once if an earlier call of `plan_ahead` with equal arguments has planned a
        motion from the current position.
        """

    def plan_ahead(self, goal: Goal | str, task: Task = Task()) -> None:
        """Plan a motion from the end of the current motion, for a later call of `plan`."""

    def start(self, motion: Motion, guard: MotionGuard = MotionGuard()) -> None:
        """Follow `motion` until its end or an event of `guard`; the arm must be at rest at its start."""
