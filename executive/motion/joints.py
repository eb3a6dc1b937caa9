"""Joints of an arm: range and limits; kinematics of the arm of a cell, by the solver that its file names."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from executive.cell.arm_config import ArmConfig, LimitsConfig
from executive.cell.config import CellConfig
from executive.errors import InputError
from executive.geometry import Array, Pose
from executive.plugins import list_entries
from executive.text.findings import suggest_choice
from executive.text.validate import KeyPath

IK_SOLVER_GROUP = "executive.ik_solvers"
"""Group of the entry points of the solvers that an arm file can name."""
SAMPLING_MARGIN = 0.001
"""Addition to the margin of the cell, because only samples of a motion are checked [m]."""

BranchKey = tuple[float, ...]
"""Key of a branch of the inverse kinematics; the meaning of the numbers depends on the arm.

In each branch, a tool pose has at most one solution, and a short path of the tool has continuous solutions.
"""


class JointRange(NamedTuple):
    """Range of the joint positions: smallest and largest positions, `(n,)` each [rad]."""

    lower: Array
    upper: Array

    def shrink(self, margin: float | Array) -> JointRange:
        """Return the range reduced at both ends by `margin` [rad], a number or one for each joint `(n,)`."""
        return JointRange(self.lower + margin, self.upper - margin)

    def contains(self, qs: Array) -> NDArray[np.bool_]:
        """Return a mask `(...)` of the joint positions `(..., n)` [rad] within the range."""
        return np.asarray(np.all((self.lower <= qs) & (qs <= self.upper), axis=-1))

    def without_last(self) -> JointRange:
        """Return the range of all joints but the last."""
        return JointRange(self.lower[:-1], self.upper[:-1])

    def compute_excess(self, qs: Array) -> Array:
        """Return the distance of each joint position `(..., n)` from the range [rad]; negative inside."""
        return np.asarray(np.maximum(qs - self.upper, self.lower - qs))

    def describe(self, joint: int) -> str:
        """Return the range of the joint with the index `joint` as text: `±170°` or `-30° to 120°`."""
        lower = math.degrees(self.lower[joint])
        upper = math.degrees(self.upper[joint])
        return f"±{upper:.0f}°" if lower == -upper else f"{lower:.0f}° to {upper:.0f}°"


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Limits of `n` joints, each an array `(n,)`.

    Attributes:
        position: Range of the joint positions.
        velocity: Maximum velocity [rad/s].
        acceleration: Maximum acceleration [rad/s²].
        jerk: Maximum jerk [rad/s³].
        stop_acceleration: Maximum acceleration during braking [rad/s²].
        stop_jerk: Maximum jerk during braking [rad/s³].
    """

    position: JointRange
    velocity: Array
    acceleration: Array
    jerk: Array
    stop_acceleration: Array
    stop_jerk: Array

    @staticmethod
    def from_config(config: LimitsConfig) -> JointLimits:
        """Return the limits of a cell file."""
        return JointLimits(
            position=JointRange(*np.radians(config.position_ranges_deg).T),
            velocity=np.radians(config.velocity_deg),
            acceleration=np.array(config.acceleration),
            jerk=np.array(config.jerk),
            stop_acceleration=np.array(config.stop_acceleration),
            stop_jerk=np.array(config.stop_jerk),
        )

    @property
    def joint_count(self) -> int:
        """Number of joints, `n`."""
        return len(self.velocity)

    def compute_min_time(self, displacement: Array) -> Array:
        """Return the minimum time `(...)` [s] from rest to rest for a `displacement` `(..., n)` [rad].

        Each joint has the symmetric seven-phase profile of limited jerk, and the slowest joint determines the
        time. A long profile reaches the maximum velocity `v`; a medium profile reaches only the maximum
        acceleration `a`; a short profile reaches only the maximum jerk `j`.
        """
        d = np.abs(displacement)
        v = self.velocity
        a = self.acceleration
        j = self.jerk
        # [s] from zero to the maximum acceleration, and to the maximum velocity
        jerk_time = a / j
        ramp_time = np.where(v >= a * jerk_time, v / a + jerk_time, 2 * np.sqrt(v / j))
        medium_time = jerk_time + np.sqrt(jerk_time**2 + 4 * d / a)
        short_time = 4 * np.cbrt(d / 2 / j)
        time_below_max_velocity = np.where(d >= 2 * a * jerk_time**2, medium_time, short_time)
        return np.max(np.where(d >= v * ramp_time, d / v + ramp_time, time_below_max_velocity), axis=-1)


class Kinematics(Protocol):
    """Kinematics of an arm with `n` joints, and of the tool on its flange.

    Poses are in the world, where the cell file places the base of the arm. The tool axis is the axis of the
    last joint.
    """

    @property
    def joint_range(self) -> JointRange:
        """Range in which each joint is within its limits, and the links at the wrist do not touch."""

    def compute_tool_pose(self, q: ArrayLike) -> Pose:
        """Return the tool pose `X_WT` at the joint positions `q` `(n,)` [rad]."""

    def compute_tcps_and_axes(self, qs: Array) -> tuple[Array, Array]:
        """Return tool centre points `(N, 3)` [m] and tool axes `(N, 3)` at joint positions `(N, n)` [rad]."""

    def find_branch(self, q: ArrayLike) -> BranchKey:
        """Return the branch of the joint positions `q` `(n,)` [rad]."""

    def solve(self, poses: Sequence[Pose], branch: BranchKey) -> Array:
        """Return the joint positions `(N, n)` [rad] of tool poses in one branch, maybe outside `joint_range`.

        Raises:
            Unreachable: A pose is too near to the arm or too far from the arm.
        """

    def solve_all(
        self, poses: Sequence[Pose], q_seed: ArrayLike, angle_step: float
    ) -> tuple[Array, Sequence[BranchKey]]:
        """Return the solutions `(N, B, n)` [rad] of `N` poses on a line, and their `B` branches.

        A solution may be outside of `joint_range`; it is NaN where a branch has none. A joint that can turn
        more than once is near its position in `q_seed` `(n,)` [rad]. A redundant arm has infinitely many
        branches, of which the function returns samples: the more, the smaller `angle_step` [rad] is.

        Raises:
            Unreachable: A pose is too near to the arm or too far from the arm.
        """


class KinematicsFactory(Protocol):
    """A solver: function or class that builds the kinematics of an arm."""

    def __call__(
        self, arm: ArmConfig, tool_length: float, min_link_distance: float | None = None
    ) -> Kinematics:
        """Return the kinematics of an arm with a tool.

        Args:
            arm: The arm of a cell.
            tool_length: Distance from the flange to the tool centre point [m].
            min_link_distance: Minimum distance between links of the wrist [m], which may make the range of
                the joints narrower than the limits, or None.

        Raises:
            InputError: The solver cannot solve this arm.
        """


def find_arm_errors(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield the key and the message of an error if the solver is not installed or cannot solve the arm."""
    try:
        build_kinematics(config)
    except InputError as error:
        yield ("arm", "solver"), str(error)


def build_kinematics(config: CellConfig, min_link_distance: float | None = None) -> Kinematics:
    """Return the kinematics of the arm of a cell file, with a minimum distance [m] between its links.

    Raises:
        InputError: The solver is not installed, or cannot solve the arm.
    """
    arm = config.arm
    solvers = list_entries(IK_SOLVER_GROUP, "solver")
    if arm.solver not in solvers:
        hint = suggest_choice(arm.solver, solvers, "Installed solvers")
        raise InputError(f'the solver "{arm.solver}" of the arm {arm.arm} is not installed. {hint}')
    factory: KinematicsFactory = solvers[arm.solver].load()
    return factory(arm, config.tool.length, min_link_distance)


def build_planning_kinematics(config: CellConfig) -> Kinematics:
    """Return the kinematics of the arm of a cell file, whose links keep the margin of planned motions."""
    return build_kinematics(config, config.motion.margin + SAMPLING_MARGIN)


def wrap_angles(angles: Array) -> Array:
    """Return the equivalent angles [rad] in [-π, π)."""
    return (angles + math.pi) % (2 * math.pi) - math.pi
