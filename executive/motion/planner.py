"""Motion planner: motions from rest to rest, as fast as the limits allow, without collision.

The planner chooses the branch of the inverse kinematics and, if the yaw of the goal is free, the final yaw.
The planner prefers the direct motion, and optimizes a detour if an obstacle blocks the direct motion. Each
motion is checked for collisions, optionally in a more exact model. The search has a maximum number of steps
instead of a timeout, so that equal queries have equal results.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from executive.cell.arm import Goal, Task
from executive.cell.clock import STEP
from executive.cell.config import CellConfig
from executive.cell.layout import compute_travel_height
from executive.errors import Blocked, Unreachable
from executive.geometry import Array
from executive.motion.arm_model import Kinematics
from executive.motion.configurations import find_configuration_pairs
from executive.motion.joints import JointLimits
from executive.motion.payload import PayloadLimit
from executive.motion.point_to_point import JointLimitError
from executive.motion.search import MotionSearch
from executive.motion.trajectory import Trajectory, downsample_path

CollisionCheck = Callable[[Array, Task], None]
"""Function that raises Blocked if the path `(N, n)` [rad] of a task collides."""

MAX_CHECK_SPACING = math.radians(1.0)
"""Maximum change of a joint between two neighbouring states that are checked for collisions [rad]."""


class Planner:
    """Plans motions of the arm of a cell file, optionally with an additional collision check.

    Attributes:
        kinematics: Kinematics of the arm.
        limits: Joint limits of the arm.
    """

    def __init__(
        self, config: CellConfig, kinematics: Kinematics, check_collision: CollisionCheck | None = None
    ) -> None:
        self.limits = JointLimits.from_config(config.arm.limits)
        self.kinematics = kinematics
        self._config = config
        self._check_collision = check_collision
        self._reach_problems: dict[Goal, str] = {}

    def plan(self, q_start: ArrayLike, goal: Goal | ArrayLike, task: Task = Task()) -> Trajectory:
        """Return a fast motion from rest at `q_start` `(n,)` [rad] to a goal or to joint positions `(n,)`.

        With a load, the motion is slowed down until the seal of the load holds.

        Raises:
            Unreachable: The goal has no joint solution inside the limits.
            Blocked: Each motion comes too close to an obstacle; the message describes the first one.
        """
        start = np.asarray(q_start, dtype=float)
        end = goal if isinstance(goal, Goal) else np.asarray(goal, dtype=float)
        motion = self._find_motion(start, end, task)
        return PayloadLimit(task.load, self.kinematics).make_safe_motion(motion) if task.load else motion

    def require_reachable(self, goal: Goal) -> None:
        """Check that the arm reaches both a goal and the travel height above the goal in the same branch.

        Raises:
            Unreachable: The arm cannot reach both; the message states the joint limit or the distance.
        """
        approach_height = max(0.0, compute_travel_height(self._config) - goal.position[2])
        find_configuration_pairs(self.kinematics, goal, approach_height, np.zeros(self.limits.joint_count))

    def describe_unreachable(self, goal: Goal) -> str:
        """Return a sentence if no configuration reaches a goal and the start of its descent, else "".

        The answer is computed once per goal, because a `guard` of the tree may ask in every control step.
        """
        if goal not in self._reach_problems:
            try:
                q_start = np.zeros(self.limits.joint_count)
                find_configuration_pairs(self.kinematics, goal, goal.guarded_length, q_start)
                self._reach_problems[goal] = ""
            except Unreachable as error:
                self._reach_problems[goal] = str(error)
        return self._reach_problems[goal]

    def _find_motion(self, start: Array, end: Goal | Array, task: Task) -> Trajectory:
        """Return the first motion of the search that passes all checks."""
        task_before_contact = _treat_target_as_obstacle(task)
        search = MotionSearch(self._config, self.kinematics, self.limits, start, end, task_before_contact)
        errors: list[str] = []
        for motion in search.plan_motions():
            try:
                self._check_motion(motion, search, task)
            except (Blocked, Unreachable, JointLimitError) as error:
                errors.append(str(error))
            else:
                return motion
        if not errors:
            raise Blocked("no motion inside the joint limits leads to the goal")
        summary = f"; all {len(errors)} motions that were tried are blocked" if len(errors) > 1 else ""
        raise Blocked(f"{errors[0]}{summary}")

    def _check_motion(self, motion: Trajectory, search: MotionSearch, task: Task) -> None:
        """Check joint limits and collisions of a motion.

        Raises:
            Blocked: The motion comes too near to an obstacle.
            Unreachable, JointLimitError: The motion exceeds the range or another limit of a joint.
        """
        qs = motion.require_limits(self.limits).q
        has_guarded_part = motion.guarded_start_time < math.inf
        # The first state always belongs to the free part, which therefore is never empty.
        free_qs = qs[: max(1, math.ceil(motion.guarded_start_time / STEP))] if has_guarded_part else qs
        search.require_clearance(free_qs)
        if self._check_collision is not None:
            free_path = downsample_path(free_qs, MAX_CHECK_SPACING)
            self._check_collision(free_path, _treat_target_as_obstacle(task))
            if has_guarded_part:
                self._check_collision(downsample_path(qs[len(free_qs) - 1 :], MAX_CHECK_SPACING), task)


def _treat_target_as_obstacle(task: Task) -> Task:
    """Return the task of the part before the guarded part, in which the target counts as an obstacle."""
    targets = () if task.target is None else (task.target,)
    return replace(task, obstacles=(*task.obstacles, *targets), target=None)
