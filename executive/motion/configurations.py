"""Joint configurations in which the tool points straight down, at a goal and along a vertical line."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from executive.cell.arm import Goal
from executive.errors import Unreachable
from executive.geometry import Array, Pose, make_tool_down_pose
from executive.motion.arm_model import BranchKey, Kinematics, Solutions, wrap_angles

PREFERRED_LIMIT_DISTANCE = math.radians(1.0)
"""Preferred minimum distance of joint positions from their limits [rad]."""
COARSE_SPACING = math.radians(5.0)
"""Distance between the redundancy angles in the first search for configurations [rad]."""
FINE_SPACING = math.radians(0.25)
"""Distance between the redundancy angles in the second search, if the first search finds nothing [rad]."""
MIN_COSINE_DOWN = 0.9998
"""Minimum cosine between the tool axis and straight down for a tool that points down."""


@dataclass(frozen=True, eq=False)
class ConfigurationPairs:
    """Joint configurations at both ends of a vertical line of the tool, `N` pairs.

    Attributes:
        high: Joint positions at the upper end `(N, n)` [rad].
        low: Joint positions at the lower end `(N, n)` [rad].
        branches: Branch of the inverse kinematics of each pair.
    """

    high: Array
    low: Array
    branches: tuple[BranchKey, ...]

    def __len__(self) -> int:
        return len(self.low)


def find_configuration_pairs(
    kinematics: Kinematics, goal: Goal, length: float, q_start: Array
) -> ConfigurationPairs:
    """Return all pairs of configurations in the joint range at a goal and `length` [m] above the goal.

    If the yaw of the goal is free, the last joint turns as little as possible from `q_start` `(n,)` [rad].

    Raises:
        Unreachable: No pair is in the joint range; the message states the position and the cause.
    """
    x, y, z = goal.position
    poses = [make_tool_down_pose((x, y, z + length)), make_tool_down_pose((x, y, z))]
    for spacing, margin in ((COARSE_SPACING, PREFERRED_LIMIT_DISTANCE), (FINE_SPACING, 0.0)):
        upper, lower = (kinematics.solve_all(pose, q_start, spacing) for pose in poses)
        high, low = upper.qs, lower.qs
        allowed = kinematics.joint_range.shrink(margin)
        _turn_last_joint(high, low, (allowed.lower[-1], allowed.upper[-1]), goal.yaw, float(q_start[-1]))
        inside = allowed.contains(high) & allowed.contains(low)
        if inside.any():
            branches = tuple(lower.branches[index] for index in np.flatnonzero(inside))
            return ConfigurationPairs(high[inside], low[inside], branches)
    raise _make_unreachable_error(kinematics, poses, (upper, lower))


def find_vertical_waypoints(kinematics: Kinematics, q: Array, length: float, count: int) -> Array | None:
    """Return evenly spaced waypoints `(count, n)` [rad] on a vertical line of the tool, or None.

    The line leads from the tool at `q` `(n,)` [rad] upwards, has the length `length` [m], and stays in the
    branch of `q`. The result is None if the tool does not point down, or if a joint would leave its range.
    """
    X_WT = kinematics.compute_tool_pose(q)
    if -X_WT.rotation[2, 2] < MIN_COSINE_DOWN:
        return None
    try:
        waypoints = _solve_waypoints(kinematics, X_WT, length, count, kinematics.find_branch(q))
    except Unreachable:
        return None
    is_inside = kinematics.joint_range.contains(waypoints).all()
    return waypoints if is_inside and np.max(np.abs(waypoints[0] - q)) < 1e-6 else None


def solve_vertical_waypoints(
    kinematics: Kinematics, q: Array, length: float, count: int, branch: BranchKey
) -> Array:
    """Return evenly spaced waypoints `(count, n)` [rad] on a vertical line of the tool in one branch.

    The line leads from the tool at `q` `(n,)` [rad] upwards, and has the length `length` [m]. The function
    checks neither the tool axis nor the joint range.

    Raises:
        Unreachable: A point of the line is too far from the arm or too near to the arm.
    """
    waypoints = _solve_waypoints(kinematics, kinematics.compute_tool_pose(q), length, count, branch)
    return waypoints + wrap_angles(q - waypoints[0])


def _solve_waypoints(
    kinematics: Kinematics, X_WT: Pose, length: float, count: int, branch: BranchKey
) -> Array:
    """Return continuous waypoints `(count, n)` [rad] on a vertical line upwards from the tool pose."""
    waypoints = np.array(
        [
            kinematics.solve(Pose(X_WT.rotation, X_WT.position + np.array([0.0, 0.0, height])), branch)
            for height in np.linspace(0.0, length, count)
        ]
    )
    waypoints[1:] = waypoints[0] + wrap_angles(waypoints[1:] - waypoints[0])
    return waypoints


def _turn_last_joint(
    high: Array, low: Array, joint_range: tuple[float, float], yaw: float | None, start: float
) -> None:
    """Turn the last joint of pairs `(N, n)` [rad] in place, from the yaw 0 of the tool to `yaw` [rad].

    If `yaw` is None, the last joint gets the position in its range that is nearest to `start` [rad].
    """
    change = wrap_angles(high[:, -1] - low[:, -1])
    if yaw is not None:
        low[:, -1] = wrap_angles(low[:, -1] - yaw)
    else:
        smallest, largest = joint_range
        low[:, -1] = np.clip(start, smallest - np.minimum(change, 0.0), largest - np.maximum(change, 0.0))
    high[:, -1] = low[:, -1] + change


def _make_unreachable_error(
    kinematics: Kinematics, poses: list[Pose], rejected: tuple[Solutions, Solutions]
) -> Unreachable:
    """Return the error for the first pose without a solution in the joint range, or for both poses."""
    for pose, solutions in zip(poses, rejected, strict=True):
        if not np.any(kinematics.joint_range.contains(solutions.qs)):
            return _make_range_error(kinematics, pose, solutions.qs)
    (x, y, top), bottom = poses[0].position, poses[1].position[2]
    return Unreachable(
        f"the tool can reach the heights {top:.3f} and {bottom:.3f} m above ({x:.3f}, {y:.3f}) m, but not "
        f"without a change of the configuration of the arm in between"
    )


def _make_range_error(kinematics: Kinematics, X_WT: Pose, qs: Array) -> Unreachable:
    """Return the error for a pose whose solutions `(N, n)` [rad] all exceed the joint range."""
    excess = kinematics.joint_range.compute_excess(qs)
    best = excess[np.nanargmin(np.max(excess, axis=1))]
    joint = int(np.argmax(best))
    x, y, z = X_WT.position
    return Unreachable(
        f"the tool cannot reach ({x:.3f}, {y:.3f}, {z:.3f}) m: no configuration of the arm keeps every joint "
        f"inside its limits; the best one leaves joint {joint + 1} {math.degrees(best[joint]):.1f}° outside "
        f"{kinematics.joint_range.describe(joint)}"
    )
