"""Planning one motion per intent: from rest to rest, as fast as the limits allow, clear of everything.

The arm has choices: its configuration and, for a round cup, the yaw of the tool at the goal, and the shape of
the path between. The planner ranks the ends by the least time there can be, flies the direct
way where nothing is in between and looks for the fastest detour where something is. What it finds is checked
in a planning world before it counts. Its budget is a number of steps, never a time: the same question always
gets the same answer.
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
from executive.cell.layout import travel_height
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
"""Takes joint positions along a path `(N, n)` [rad] and what it has to heed; raises Blocked."""

MAX_CHECK_SPACING = math.radians(1.0)
"""Largest joint move between the states whose clearance is checked [rad]."""


class Planner:
    """Plans motions of the arm of a cell file.

    Args:
        config: The cell file.
        kinematics: Kinematics of its arm.
        check: The last word on clearance; by default none beyond the search's own.

    Attributes:
        kinematics: Kinematics of the arm.
        limits: Its joints'.
    """

    def __init__(self, config: CellConfig, kinematics: Kinematics, check: Check | None = None) -> None:
        self.limits = JointLimits.of(config.arm.limits)
        self.kinematics = kinematics
        self._config = config
        self._check = check
        self._height = travel_height(config)

    def plan(self, q_start: ArrayLike, goal: Goal | ArrayLike, task: Task = Task()) -> Trajectory:
        """Return the fastest motion found from rest at `q_start` `(n,)` [rad] to a goal or joint positions.

        Raises:
            Unreachable: The goal has no joint solution inside the limits.
            Blocked: Every way tried comes too close to something; the text is the fastest one's.
        """
        start = np.asarray(q_start, dtype=float)
        end = goal if isinstance(goal, Goal) else np.asarray(goal, dtype=float)
        trajectory = self._plan(start, end, task)
        return PayloadLimit(task.load, self.kinematics).gentle(trajectory) if task.load else trajectory

    def require_reachable(self, goal: Goal) -> None:
        """Make sure that a goal and travel height above it can be reached from somewhere in one posture.

        Raises:
            Unreachable: They cannot; the text says how far off it is.
        """
        rise = max(0.0, self._height - goal.position[2])
        find_postures(self.kinematics, goal, rise, np.zeros(self.limits.joint_count))

    def _plan(self, start: Array, end: Goal | Array, task: Task) -> Trajectory:
        search = Search(self._config, self.kinematics, self.limits, start, end, _task_of_free_part(task))
        blocked: list[str] = []
        for motion in search.candidates():
            try:
                self._require_clear(motion, search, task)
            except (Blocked, Unreachable, NoProfile) as error:
                blocked.append(str(error))
            else:
                return motion
        others = f"; of {len(blocked)} ways tried none is free" if len(blocked) > 1 else ""
        raise Blocked(f"{blocked[0]}{others}" if blocked else "no way there can be flown")

    def _require_clear(self, motion: Trajectory, search: Search, task: Task) -> None:
        """Make sure that a motion keeps the joints' limits and its distances.

        Raises:
            Blocked: It comes too near to something.
            Unreachable, NoProfile: It leaves a joint's range, or exceeds another limit.
        """
        qs = motion.check(self.limits).q
        guarded = motion.guarded < math.inf
        free = qs[: math.ceil(motion.guarded / STEP)] if guarded else qs
        search.require_clear(free)
        if self._check is not None:
            self._check(thin_out(free, MAX_CHECK_SPACING), _task_of_free_part(task))
            if guarded:
                self._check(thin_out(qs[len(free) - 1 :], MAX_CHECK_SPACING), task)


def _task_of_free_part(task: Task) -> Task:
    """Return the task of the free part of a motion: what is to be touched in the end stands around, too."""
    return task if task.target is None else replace(task, around=(*task.around, task.target), target=None)
