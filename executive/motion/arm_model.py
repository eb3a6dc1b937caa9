"""Kinematics that the planner needs from an arm, with any number of joints."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

from numpy.typing import ArrayLike

from executive.geometry import Array, Pose
from executive.motion.limits import JointRange

Configuration = tuple[float, ...]
"""Key of one of the inverse-kinematics solutions of a tool pose.

Only the kinematics that returned a key knows the meaning of its numbers. Along a short path of the tool, the
solutions with the same key are continuous.
"""


class Solutions(NamedTuple):
    """Inverse-kinematics solutions of one tool pose, `N` of them.

    Attributes:
        qs: Joint positions `(N, n)` [rad], not limited to the joint range; NaN in the row of a configuration
            that does not reach the pose.
        configurations: Key of each row.
    """

    qs: Array
    configurations: Sequence[Configuration]


class Kinematics(Protocol):
    """Kinematics of an arm with `n` joints, at the world's origin, and of the tool on its flange.

    The tool axis is the axis of the last joint: a turn of the last joint turns the tool about the tool axis.
    """

    @property
    def joint_range(self) -> JointRange:
        """Joint positions at which no joint limit is exceeded and no link touches the next one."""

    def forward(self, q: ArrayLike) -> Pose:
        """Return the tool pose `X_WT` at the joint positions `q` `(n,)` [rad]."""

    def flange(self, q: ArrayLike) -> Pose:
        """Return the flange pose `X_WF` at `q` `(n,)` [rad]."""

    def joint_frames(self, q: ArrayLike) -> tuple[Pose, ...]:
        """Return the frame of each joint at `q` `(n,)` [rad]; its origin is the centre of the joint."""

    def tips(self, qs: Array) -> tuple[Array, Array]:
        """Return the tool centre points `(N, 3)` [m] and the tool axes `(N, 3)` at `qs` `(N, n)` [rad]."""

    def configuration(self, q: ArrayLike) -> Configuration:
        """Return the key of the configuration of `q` `(n,)` [rad]."""

    def solve(self, X_WT: Pose, configuration: Configuration) -> Array:
        """Return the joint positions `(n,)` [rad] of a tool pose in one configuration.

        The joint range is not checked.

        Raises:
            Unreachable: The pose is too near to the arm or too far from the arm.
        """

    def solve_all(self, X_WT: Pose, near: ArrayLike, spacing: float) -> Solutions:
        """Return the solutions of a tool pose in all configurations.

        Calls with the same `near` and `spacing` return the same configurations in the same order.

        Args:
            X_WT: Tool pose.
            near: Joint positions `(n,)` [rad] whose redundancy angle is among the returned ones.
            spacing: Distance between the redundancy angles that are returned [rad]; an arm without redundancy
                ignores it.

        Raises:
            Unreachable: The pose is too near to the arm or too far from the arm.
        """


def wrap_angles(angles: Array) -> Array:
    """Return `angles` [rad], changed by full turns, in [-π, π)."""
    return (angles + math.pi) % (2 * math.pi) - math.pi
