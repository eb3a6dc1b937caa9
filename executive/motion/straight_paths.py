"""Motions on straight joint paths: up, across and down, at a constant speed of the fastest joint."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from executive.cell.arm import Goal, JointState, Task
from executive.cell.config import CellConfig
from executive.cell.device_config import STEP
from executive.errors import Blocked, Unreachable
from executive.geometry import Array
from executive.motion.clearance_model import ClearanceModel, make_tool_discs
from executive.motion.configurations import (
    find_configuration_pairs,
    find_vertical_waypoints,
    solve_vertical_waypoints,
)
from executive.motion.joints import Kinematics
from executive.motion.search import EXTRA_HEIGHTS

JOINT_SPEED = 1.5
"""Speed of the fastest joint outside of guarded motions [rad/s]."""


@dataclass(frozen=True, eq=False)
class StraightMotion:
    """A motion on straight joint paths; implements `executive.cell.arm.Motion`.

    Attributes:
        start: Joint positions at the start `(n,)` [rad].
        qs: Joint positions `(N, n)` [rad] after each interval of `STEP`.
        guarded_start_time: Infinite: the arm of a cell without physics touches nothing by itself.
    """

    start: Array
    qs: Array
    guarded_start_time: float = math.inf

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return len(self.qs) * STEP

    def state_at(self, time: float) -> JointState:
        """Return the joint positions after the last interval before `time` [s], at rest."""
        index = min(round(time / STEP), len(self.qs))
        return JointState.at_rest(self.qs[index - 1] if index > 0 else self.start)


def plan_straight_motion(
    config: CellConfig, kinematics: Kinematics, start: Array, goal: Goal | Array, task: Task
) -> StraightMotion:
    """Return a motion from `start` `(n,)` [rad] to a goal or to joint positions `(n,)` [rad].

    The motion rises to the travel height, crosses, and descends. It is blocked if tool or load would come
    nearer to an obstacle than the cell file permits; the links of the arm are not checked.

    Raises:
        Blocked, Unreachable: The error of the first attempt, if no attempt finds a motion.
    """
    errors: list[Exception] = []
    travel_height = config.travel_height
    rise = max(0.0, travel_height - float(kinematics.compute_tool_pose(start).position[2]))
    attempts = [(rise + extra_height, travel_height + extra_height) for extra_height in EXTRA_HEIGHTS]
    for attempt in attempts if isinstance(goal, Goal) else [(0.0, 0.0), *attempts]:
        try:
            qs = _find_path(kinematics, start, goal, *attempt)
            _require_clearance(config, kinematics, np.vstack([start, qs]), task)
            return StraightMotion(start, qs)
        except (Blocked, Unreachable) as error:
            errors.append(error)
    raise errors[0]


def _find_path(kinematics: Kinematics, start: Array, goal: Goal | Array, rise: float, height: float) -> Array:
    """Return joint positions `(N, n)` [rad] of a path up by `rise` [m], and down from `height` [m]."""
    waypoints = find_vertical_waypoints(kinematics, start, rise)
    corners = start[None] if waypoints is None else waypoints
    if not isinstance(goal, Goal):
        return _interpolate(np.vstack([corners, goal]), 0.0)
    pairs = find_configuration_pairs(kinematics, goal, goal.guarded_length, start)
    # The largest change of a joint would be smaller with another norm, but the tool would sink more.
    nearest = np.argmin(np.linalg.norm(pairs.upper_qs - corners[-1], axis=1))
    length = max(0.0, height - goal.position[2] - goal.guarded_length)
    branch = pairs.branches[nearest]
    descent = solve_vertical_waypoints(kinematics, pairs.upper_qs[nearest], length, branch)
    corners = np.vstack([corners, descent[::-1], pairs.lower_qs[nearest]])
    return _interpolate(corners, goal.guarded_length / goal.guarded_speed)


def _require_clearance(config: CellConfig, kinematics: Kinematics, qs: Array, task: Task) -> None:
    """Raise Blocked if tool or load come too near to an obstacle at joint positions `(N, n)` [rad]."""
    tcps, axes = kinematics.compute_tcps_and_axes(qs)
    discs = make_tool_discs(config, task.load)._replace(min_cosine=-1.0)
    # Only other objects may be as near as they are at the ends: the goal may not be inside table or bins.
    for obstacles, min_margin in (((), 0.0), (task.obstacles, -math.inf)):
        clearance = ClearanceModel(config, obstacles, tcps[[0, -1], :2], discs)
        clearance.relax_end_margins(tcps[[0, -1]], axes[[0, -1]], min_margin)
        clearance.require_clearance(tcps, axes)


def _interpolate(corners: Array, min_last_time: float) -> Array:
    """Return the joint positions after each control step on straight lines between corners `(K, n)` [rad].

    The last line takes at least `min_last_time` [s].
    """
    times = np.abs(np.diff(corners, axis=0)).max(axis=1) / JOINT_SPEED
    times[-1] = max(times[-1], min_last_time)
    corner_times = np.cumsum([0.0, *times])
    step_times = np.append(np.arange(STEP, corner_times[-1], STEP), corner_times[-1])
    return np.column_stack([np.interp(step_times, corner_times, joint) for joint in corners.T])
