"""Motion planner: motions from rest to rest, as fast as the limits allow, without collision.

The planner chooses the branch of the inverse kinematics and, among the permitted ones, the final yaw.
The planner prefers the direct motion, and optimizes a detour if an obstacle blocks the direct motion. Each
motion is checked for collisions, optionally in a more exact model. The search has a maximum number of steps
instead of a timeout, so that equal queries have equal results.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from executive.cell.arm import Goal, JointState, Task
from executive.cell.config import CellConfig
from executive.cell.device_config import STEP
from executive.errors import Blocked, Unreachable
from executive.geometry import Array
from executive.motion.clearance_model import ClearanceModel, make_tool_discs
from executive.motion.configurations import (
    find_configuration_pairs,
    find_vertical_waypoints,
    solve_straight_waypoints,
)
from executive.motion.joints import JointLimits, Kinematics, build_planning_kinematics
from executive.motion.optimizer import MotionProblem
from executive.motion.search import EXTRA_HEIGHTS, MotionSearch
from executive.motion.trajectory import JointLimitError, Trajectory, downsample_path

CollisionCheck = Callable[[Array, Task], None]
"""Function that raises Blocked if the path `(N, n)` [rad] of a task collides."""

MAX_CHECK_SPACING = math.radians(1.0)
"""Maximum change of a joint between two neighbouring states that are checked for collisions [rad]."""
JOINT_SPEED = 1.5
"""Speed of the fastest joint outside of guarded motions [rad/s]."""


class Planner:
    """Plans motions of the arm of a cell file.

    Args:
        config: The cell file.
        check_collision: Additional collision check, or None.
        kinematics: Kinematics of the arm; None: those of `config.arm`.

    Attributes:
        kinematics: Kinematics of the arm.
        limits: Joint limits of the arm.
    """

    def __init__(
        self,
        config: CellConfig,
        check_collision: CollisionCheck | None = None,
        kinematics: Kinematics | None = None,
    ) -> None:
        self.limits = JointLimits.from_config(config.arm.limits)
        self.kinematics = kinematics or build_planning_kinematics(config)
        self._config = config
        self._check_collision = check_collision

    def plan(self, q_start: ArrayLike, goal: Goal | ArrayLike, task: Task = Task()) -> Trajectory:
        """Return a fast motion from rest at `q_start` `(n,)` [rad] to a goal or to joint positions `(n,)`.

        The motion is the first one of the search that passes all checks. With a load, it is then slowed down
        until the tool holds the load.

        Raises:
            Unreachable: The goal has no joint solution inside the limits.
            Blocked: Each motion comes too close to an obstacle; the message describes the first one.
        """
        start = np.asarray(q_start, dtype=float)
        end = goal if isinstance(goal, Goal) else np.asarray(goal, dtype=float)
        task_before_contact = _treat_target_as_obstacle(task)
        search = MotionSearch(self._config, self.kinematics, start, end, task_before_contact)
        errors: list[str] = []
        for motion in search.plan_motions():
            try:
                self._check_motion(motion, search.problem, task)
            except (Blocked, Unreachable, JointLimitError) as error:
                errors.append(str(error))
            else:
                payload = search.problem.payload
                return payload.make_safe_motion(motion) if payload else motion
        if not errors:
            raise Blocked("no motion inside the joint limits leads to the goal")
        summary = f"; all {len(errors)} motions that were tried are blocked" if len(errors) > 1 else ""
        raise Blocked(f"{errors[0]}{summary}")

    def _check_motion(self, motion: Trajectory, problem: MotionProblem, task: Task) -> None:
        """Check joint limits and collisions of a motion.

        Raises:
            Blocked: The motion comes too near to an obstacle.
            Unreachable, JointLimitError: The motion exceeds the range or another limit of a joint.
        """
        qs = motion.require_limits(self.limits).q
        has_guarded_part = motion.guarded_start_time < math.inf
        # The first state always belongs to the free part, which therefore is never empty.
        free_qs = qs[: max(1, math.ceil(motion.guarded_start_time / STEP))] if has_guarded_part else qs
        problem.clearance.require_clearance(*self.kinematics.compute_tcps_and_axes(free_qs))
        if self._check_collision is not None:
            free_path = downsample_path(free_qs, MAX_CHECK_SPACING)
            self._check_collision(free_path, _treat_target_as_obstacle(task))
            if has_guarded_part:
                # The load may touch what is below it.
                task = replace(task, load=None)
                self._check_collision(downsample_path(qs[len(free_qs) - 1 :], MAX_CHECK_SPACING), task)


def _treat_target_as_obstacle(task: Task) -> Task:
    """Return the task of the part before the guarded part, in which the target counts as an obstacle."""
    targets = () if task.target is None else (task.target,)
    return replace(task, obstacles=(*task.obstacles, *targets), target=None)


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
            is_guarded = isinstance(goal, Goal) and goal.guarded_length > 0
            _require_clearance(config, kinematics, np.vstack([start, qs]), task, is_guarded=is_guarded)
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
    length = max(0.0, height - goal.compute_line_start(goal.guarded_length)[2])
    branch = pairs.branches[nearest]
    descent = solve_straight_waypoints(kinematics, pairs.upper_qs[nearest], length, branch)
    corners = np.vstack([corners, descent[::-1], pairs.lower_qs[nearest]])
    return _interpolate(corners, goal.guarded_length / goal.guarded_speed)


def _require_clearance(
    config: CellConfig, kinematics: Kinematics, qs: Array, task: Task, *, is_guarded: bool
) -> None:
    """Raise Blocked if tool or load come too near to an obstacle at joint positions `(N, n)` [rad]."""
    tcps, axes = kinematics.compute_tcps_and_axes(qs)
    discs = make_tool_discs(config, task.load, task.opening)._replace(min_cosine=-1.0)
    # Only other objects may be as near as they are at the ends: the goal may not be inside table or bins,
    # except that of a load at the end of a guarded descent, which ends at the contact.
    min_fixed_margin = -math.inf if task.load and is_guarded else 0.0
    for obstacles, min_margin in (((), min_fixed_margin), (task.obstacles, -math.inf)):
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
