"""Motion planner: motions from rest to rest, as fast as the limits allow, without collision.

The planner chooses the branch of the inverse kinematics and, among the permitted ones, the final yaw.
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
from executive.cell.config import CellConfig
from executive.cell.device_config import STEP
from executive.errors import Blocked, Unreachable
from executive.geometry import Array
from executive.motion.arms import build_planning_kinematics
from executive.motion.joints import JointLimits, Kinematics
from executive.motion.optimizer import MotionProblem
from executive.motion.search import MotionSearch
from executive.motion.trajectory import JointLimitError, Trajectory, downsample_path

CollisionCheck = Callable[[Array, Task], None]
"""Function that raises Blocked if the path `(N, n)` [rad] of a task collides."""

MAX_CHECK_SPACING = math.radians(1.0)
"""Maximum change of a joint between two neighbouring states that are checked for collisions [rad]."""


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
        search = MotionSearch(self._config, self.kinematics, self.limits, start, end, task_before_contact)
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
                self._check_collision(downsample_path(qs[len(free_qs) - 1 :], MAX_CHECK_SPACING), task)


def _treat_target_as_obstacle(task: Task) -> Task:
    """Return the task of the part before the guarded part, in which the target counts as an obstacle."""
    targets = () if task.target is None else (task.target,)
    return replace(task, obstacles=(*task.obstacles, *targets), target=None)
