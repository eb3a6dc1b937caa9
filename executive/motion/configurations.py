"""Joint configurations at goals and on vertical lines, and candidates for the end of a motion."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from executive.cell.arm import Goal
from executive.errors import Unreachable
from executive.geometry import Array, Pose, make_tool_down_pose
from executive.motion.cartesian_line import CartesianLine
from executive.motion.joints import (
    BranchKey,
    JointLimits,
    JointRange,
    JointState,
    Kinematics,
    Solutions,
    compute_min_time,
    wrap_angles,
)

PREFERRED_LIMIT_DISTANCE = math.radians(1.0)
"""Preferred minimum distance of joint positions from their limits [rad]."""
COARSE_ANGLE_STEP = math.radians(5.0)
"""Distance between the redundancy angles in the first search for configurations [rad]."""
FINE_ANGLE_STEP = math.radians(0.25)
"""Distance between the redundancy angles in the second search, if the first search finds nothing [rad]."""
WAYPOINT_COUNT = 4
"""Number of waypoints on a vertical line."""
MIN_COSINE_ON_LINE = 0.9998
"""Minimum cosine between the tool axis and straight down at the start of a vertical line."""
_MAX_SOLUTION_ERROR = 1e-6  # [rad]


@dataclass(frozen=True, eq=False)
class ConfigurationPairs:
    """`N` pairs of joint configurations at the two ends of a vertical line of the tool.

    Attributes:
        upper_qs, lower_qs: Joint positions at the upper and the lower end, `(N, n)` each [rad].
        branches: Branch of the inverse kinematics of each pair.
    """

    upper_qs: Array
    lower_qs: Array
    branches: tuple[BranchKey, ...]


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
    for angle_step, margin in ((COARSE_ANGLE_STEP, PREFERRED_LIMIT_DISTANCE), (FINE_ANGLE_STEP, 0.0)):
        upper, lower = (kinematics.solve_all(pose, q_start, angle_step) for pose in poses)
        joint_range = kinematics.joint_range.shrink(margin)
        _turn_last_joint(upper.qs, lower.qs, joint_range, goal.yaw, float(q_start[-1]))
        is_inside = joint_range.contains(upper.qs) & joint_range.contains(lower.qs)
        if is_inside.any():
            branches = tuple(lower.branches[index] for index in np.flatnonzero(is_inside))
            return ConfigurationPairs(upper.qs[is_inside], lower.qs[is_inside], branches)
    raise _make_unreachable_error(kinematics, poses, (upper, lower))


def find_vertical_waypoints(kinematics: Kinematics, q: Array, length: float) -> Array | None:
    """Return evenly spaced waypoints `(WAYPOINT_COUNT, n)` [rad] on a vertical line of the tool, or None.

    The line leads from the tool at `q` `(n,)` [rad] upwards, is `length` [m] long, and stays in the branch of
    `q`. The result is None if the tool does not point down, or if a joint would leave its range.
    """
    X_WT = kinematics.compute_tool_pose(q)
    if -X_WT.rotation[2, 2] < MIN_COSINE_ON_LINE:
        return None
    try:
        waypoints = _solve_waypoints(kinematics, X_WT, length, kinematics.find_branch(q))
    except Unreachable:
        return None
    is_inside = kinematics.joint_range.contains(waypoints).all()
    return waypoints if is_inside and np.max(np.abs(waypoints[0] - q)) < _MAX_SOLUTION_ERROR else None


def solve_vertical_waypoints(kinematics: Kinematics, q: Array, length: float, branch: BranchKey) -> Array:
    """Return evenly spaced waypoints `(WAYPOINT_COUNT, n)` [rad] on a vertical line, in one branch.

    The line of `length` [m] leads upwards from `q` `(n,)` [rad]; tool axis and joint range are not checked.

    Raises:
        Unreachable: A point of the line is too far from the arm or too near to the arm.
    """
    waypoints = _solve_waypoints(kinematics, kinematics.compute_tool_pose(q), length, branch)
    return waypoints + wrap_angles(q - waypoints[0])


def _solve_waypoints(kinematics: Kinematics, X_WT: Pose, length: float, branch: BranchKey) -> Array:
    """Return continuous waypoints `(WAYPOINT_COUNT, n)` [rad] on a vertical line upwards from `X_WT`."""
    positions = X_WT.position + np.outer(np.linspace(0.0, length, WAYPOINT_COUNT), [0.0, 0.0, 1.0])
    waypoints = kinematics.solve([Pose(X_WT.rotation, position) for position in positions], branch)
    waypoints[1:] = waypoints[0] + wrap_angles(waypoints[1:] - waypoints[0])
    return waypoints


def _turn_last_joint(
    upper_qs: Array, lower_qs: Array, joint_range: JointRange, yaw: float | None, last_joint_start: float
) -> None:
    """Turn the last joint of pairs `(N, n)` [rad] in place, from the yaw 0 of the tool to `yaw` [rad].

    If `yaw` is None, the last joint gets the position in its range nearest to `last_joint_start` [rad].
    """
    change = wrap_angles(upper_qs[:, -1] - lower_qs[:, -1])
    if yaw is not None:
        lower_qs[:, -1] = wrap_angles(lower_qs[:, -1] - yaw)
    else:
        # Both ends of the line must be in the range.
        smallest = joint_range.lower[-1] - np.minimum(change, 0.0)
        largest = joint_range.upper[-1] - np.maximum(change, 0.0)
        lower_qs[:, -1] = np.clip(last_joint_start, smallest, largest)
    upper_qs[:, -1] = lower_qs[:, -1] + change


def _make_unreachable_error(
    kinematics: Kinematics, poses: list[Pose], end_solutions: tuple[Solutions, Solutions]
) -> Unreachable:
    """Return the error for the first pose without a solution in the joint range.

    If each pose has a solution, the error states that no branch contains solutions of both poses.
    """
    for pose, solutions in zip(poses, end_solutions, strict=True):
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
    min_excess = excess[np.nanargmin(np.max(excess, axis=1))]
    joint = int(np.argmax(min_excess))
    x, y, z = X_WT.position
    return Unreachable(
        f"the tool cannot reach ({x:.3f}, {y:.3f}, {z:.3f}) m: no configuration of the arm keeps every joint "
        f"inside its limits; the best configuration leaves joint {joint + 1} "
        f"{math.degrees(min_excess[joint]):.1f}° outside {kinematics.joint_range.describe(joint)}"
    )


MIN_JOINT_DIFFERENCE = 0.2
"""Minimum difference between two candidates in the joint that differs most [rad]."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A candidate for the end of a motion that consists of a free part and an optional straight arrival.

    Attributes:
        min_duration: Minimum duration of the free part [s].
        free_part_end: Joint state at the end of the free part.
        arrival: Straight motion of the tool downwards from `free_part_end`, or None.
        branch: Branch of the inverse kinematics at the end, or None for given joint positions.
    """

    min_duration: float
    free_part_end: JointState
    arrival: CartesianLine | None
    branch: BranchKey | None

    @property
    def arrival_duration(self) -> float:
        """Duration of `arrival` [s]."""
        return self.arrival.duration if self.arrival else 0.0


def find_candidates(
    kinematics: Kinematics, limits: JointLimits, start: JointState, goal: Goal, length: float
) -> Iterator[Candidate]:
    """Yield candidates for motions from `start` to a goal, in the order of their minimum durations.

    The arrival is the last `length` [m] of each motion; 0: no arrival.

    Raises:
        Unreachable: No joint configuration reaches the goal.
    """
    pairs = find_configuration_pairs(kinematics, goal, length, start.q)
    durations = compute_min_time(pairs.upper_qs - start.q, limits)
    previous_qs: list[Array] = []
    for index in np.argsort(durations, kind="stable"):
        goal_q, branch = pairs.lower_qs[index], pairs.branches[index]
        if any(np.max(np.abs(goal_q - q)) <= MIN_JOINT_DIFFERENCE for q in previous_qs):
            continue
        previous_qs.append(goal_q)
        arrival, free_part_end = None, JointState.at_rest(goal_q)
        if length > 0:
            waypoints = solve_vertical_waypoints(kinematics, goal_q, length, branch)[::-1]
            arrival = CartesianLine(waypoints, length, limits, goal.guarded_speed, starts_in_motion=True)
            free_part_end = arrival.state_at(0.0)
        yield Candidate(float(durations[index]), free_part_end, arrival, branch)
