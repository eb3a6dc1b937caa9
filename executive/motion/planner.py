"""Motion planner: one motion from rest to rest, as fast as the limits allow, without collision.

The planner chooses the configuration and, if the yaw of the goal is free, the yaw at the end. The planner
prefers the direct motion, and optimizes a detour if an obstacle is in between. Each motion is checked,
optionally in a more exact model. A number of steps, not a time, limits the search: equal queries have equal
results.
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
from executive.motion.limits import JointLimits
from executive.motion.payload import PayloadLimit
from executive.motion.point_to_point import NoProfile
from executive.motion.postures import find_postures
from executive.motion.search import Search
from executive.motion.trajectory import Trajectory, thin_out

Check = Callable[[Array, Task], None]
"""Checks joint positions along a path `(N, n)` [rad] with load and obstacles of a task; raises Blocked."""

MAX_CHECK_SPACING = math.radians(1.0)
"""Maximum joint motion between two states of a path that are checked for collisions [rad]."""


class Planner:
    """Plans motions of the arm of a cell file.

    Args:
        config: Content of the cell file.
        kinematics: Kinematics of the arm.
        check: Additional collision check of each motion, or None.

    Attributes:
        kinematics: Kinematics of the arm.
        limits: Joint limits of the arm.
    """

    def __init__(self, config: CellConfig, kinematics: Kinematics, check: Check | None = None) -> None:
        self.limits = JointLimits.of(config.arm.limits)
        self.kinematics = kinematics
        self._config = config
        self._check = check

    def plan(self, q_start: ArrayLike, goal: Goal | ArrayLike, task: Task = Task()) -> Trajectory:
        """Return the fastest motion found from rest at `q_start` `(n,)` [rad] to a goal or joint positions.

        Raises:
            Unreachable: The goal has no joint solution inside the limits.
            Blocked: Each candidate comes too close to an obstacle; the text describes the first candidate.
        """
        start = np.asarray(q_start, dtype=float)
        end = goal if isinstance(goal, Goal) else np.asarray(goal, dtype=float)
        trajectory = self._plan(start, end, task)
        return PayloadLimit(task.load, self.kinematics).slow_down(trajectory) if task.load else trajectory

    def require_reachable(self, goal: Goal) -> None:
        """Raise an error if no posture reaches both a goal and the travel height above the goal.

        Raises:
            Unreachable: No posture does; the text states the excess of the best posture.
        """
        rise = max(0.0, compute_travel_height(self._config) - goal.position[2])
        find_postures(self.kinematics, goal, rise, np.zeros(self.limits.joint_count))

    def _plan(self, start: Array, end: Goal | Array, task: Task) -> Trajectory:
        search = Search(self._config, self.kinematics, self.limits, start, end, _task_of_free_part(task))
        problems: list[str] = []
        for motion in search.list_motions():
            try:
                self._require_clear(motion, search, task)
            except (Blocked, Unreachable, NoProfile) as error:
                problems.append(str(error))
            else:
                return motion
        if not problems:
            raise Blocked("no motion inside the joint limits leads there")
        others = f"; all {len(problems)} motions that were tried are blocked" if len(problems) > 1 else ""
        raise Blocked(f"{problems[0]}{others}")

    def _require_clear(self, motion: Trajectory, search: Search, task: Task) -> None:
        """Raise an error if a motion exceeds a joint limit or comes too near to an obstacle.

        Raises:
            Blocked: The motion comes too near to an obstacle.
            Unreachable, NoProfile: The motion exceeds the range or another limit of a joint.
        """
        qs = motion.check(self.limits).q
        is_guarded = motion.guarded < math.inf
        free_qs = qs[: math.ceil(motion.guarded / STEP)] if is_guarded else qs
        search.require_clear(free_qs)
        if self._check is not None:
            self._check(thin_out(free_qs, MAX_CHECK_SPACING), _task_of_free_part(task))
            if is_guarded:
                self._check(thin_out(qs[len(free_qs) - 1 :], MAX_CHECK_SPACING), task)


def _task_of_free_part(task: Task) -> Task:
    """Return the task of the free part of a motion, in which the tool must not touch the target."""
    return task if task.target is None else replace(task, around=(*task.around, task.target), target=None)
