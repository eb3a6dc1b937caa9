"""Protocol of the kinematics that the planner needs from an arm, with any number of joints."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

from numpy.typing import ArrayLike

from executive.geometry import Array, Pose
from executive.motion.joints import JointRange

BranchKey = tuple[float, ...]
"""Key of a branch of the inverse kinematics; the meaning of the numbers depends on the arm.

In each branch, a tool pose has at most one solution, and a short path of the tool has continuous solutions.
"""


class Solutions(NamedTuple):
    """Inverse-kinematics solutions of one tool pose in `N` branches.

    Attributes:
        qs: Joint positions `(N, n)` [rad], possibly outside the joint range; NaN in rows without a solution.
        branches: Branch of each row.
    """

    qs: Array
    branches: Sequence[BranchKey]


class Kinematics(Protocol):
    """Kinematics of an arm with `n` joints, and of the tool on its flange.

    The base frame of the arm is the world frame. The tool axis is the axis of the last joint.
    """

    @property
    def joint_range(self) -> JointRange:
        """Range in which each joint is within its limits, and the links at the wrist do not touch."""

    def compute_tool_pose(self, q: ArrayLike) -> Pose:
        """Return the tool pose `X_WT` at the joint positions `q` `(n,)` [rad]."""

    def compute_joint_frames(self, q: ArrayLike) -> tuple[Pose, ...]:
        """Return the frame of each joint at `q` `(n,)` [rad]; each origin is the centre of its joint."""

    def compute_tcps_and_axes(self, qs: Array) -> tuple[Array, Array]:
        """Return tool centre points `(N, 3)` [m] and tool axes `(N, 3)` at joint positions `(N, n)` [rad]."""

    def find_branch(self, q: ArrayLike) -> BranchKey:
        """Return the branch of the joint positions `q` `(n,)` [rad]."""

    def solve(self, poses: Sequence[Pose], branch: BranchKey) -> Array:
        """Return the joint positions `(N, n)` [rad] of tool poses in one branch, maybe outside `joint_range`.

        Raises:
            Unreachable: A pose is too near to the arm or too far from the arm.
        """

    def solve_all(self, X_WT: Pose, q_seed: ArrayLike, angle_step: float) -> Solutions:
        """Return the solutions of a tool pose in all branches.

        A redundant arm has infinitely many branches; the function samples the redundancy angle at intervals
        of `angle_step` [rad]. One sample is the redundancy angle of `q_seed` `(n,)` [rad]. Calls with equal
        `q_seed` and `angle_step` return equal branches in equal order.

        Raises:
            Unreachable: The pose is too near to the arm or too far from the arm.
        """


def wrap_angles(angles: Array) -> Array:
    """Return the equivalent angles [rad] in [-π, π)."""
    return (angles + math.pi) % (2 * math.pi) - math.pi
