"""Arm that plans in a worker thread; a plan becomes ready after the planning time of the cell."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from executive.cell.arm import Goal, Motion, Task, reject_generator
from executive.cell.config import CellConfig
from executive.cell.futures import wait_until_done
from executive.cell.protocols import Clock
from executive.errors import Fault
from executive.events import Emit, MotionPlanned
from executive.geometry import Array, Pose
from executive.motion.planner import Planner

M = TypeVar("M", bound=Motion)
"""Type of the motions of an arm."""


@dataclass(eq=False)
class Plan(Generic[M]):
    """Planning of a motion, in progress or finished; implements `executive.cell.arm.Planning`.

    Attributes:
        clock: Clock of the run.
        ready_time: Time before which the plan is not ready [s].
        future: Planned motion, or exception of the planner, from the worker thread.
        report: Function that is called once when the plan is ready, or None.
    """

    clock: Clock
    ready_time: float
    future: Future[M]
    report: Callable[[], None] | None = None

    @property
    def ready(self) -> bool:
        """True if the time `ready_time` has come.

        This property waits for the worker at `ready_time`, so that the time at which a motion becomes
        available does not depend on the speed of the computer. If the plan is ready, the first read of the
        property calls `report`.
        """
        if self.clock.now < self.ready_time - self.clock.step / 2:
            return False
        wait_until_done(self.future)
        if self.report is not None:
            report, self.report = self.report, None
            report()
        return True

    def result(self) -> M:
        """Return the motion.

        Raises:
            Unreachable: The goal has no joint solution inside the limits.
            Blocked: Every candidate comes too close to an obstacle.
        """
        return self.future.result()


class PlanningArm(Generic[M]):
    """Base class of arms that plan motions in a worker thread and keep one plan for a later request.

    Args:
        config: The cell file.
        planner: Motion planner with the kinematics of the arm.
        clock: Clock of the run.
        emit: Function that receives an event for each requested plan when the plan is ready.

    Attributes:
        planner: Motion planner with the kinematics of the arm.
        poses: Joint positions `(n,)` [rad] of each named pose of the cell file.
        collision: Description of the collision that ended the last motion, or None.
        contact_point: Point of the collision in the world `(x, y, z)` [m]; None: unknown, or no collision.
    """

    def __init__(self, config: CellConfig, planner: Planner, clock: Clock, emit: Emit) -> None:
        self.planner = planner
        self.poses = {name: np.radians(pose) for name, pose in config.arm.poses_deg.items()}
        self.collision: str | None = None
        self.contact_point: Sequence[float] | None = None
        self._clock = clock
        self._planning_time = config.motion.planning_time
        self._emit = emit
        self._worker = ThreadPoolExecutor(1, "planner")
        self._stored_query: tuple[bytes, Goal | str, Task] | None = None
        self._stored_plan: Plan[M] | None = None

    @property
    def q(self) -> Array:
        """Joint positions `(n,)` [rad]."""
        raise NotImplementedError

    @property
    def at_rest(self) -> bool:
        """True while the arm neither follows a motion nor brakes."""
        raise NotImplementedError

    @property
    def _end_q(self) -> Array:
        """Joint positions `(n,)` [rad] at the end of the running motion, or now if the arm is at rest."""
        raise NotImplementedError

    def _plan_motion(self, start: Array, goal: Goal | str, task: Task) -> M:
        """Return a motion from rest at `start` `(n,)` [rad]; called in the worker thread."""
        raise NotImplementedError

    @property
    def tool_pose(self) -> Pose:
        """Pose of the tool centre point in the world."""
        return self.planner.kinematics.compute_tool_pose(self.q)

    @property
    def destination(self) -> Array:
        """Position of the tool `(3,)` [m] at the end of the running motion, or now if the arm is at rest."""
        return self.planner.kinematics.compute_tool_pose(self._end_q).position

    def describe_unreachable(self, goal: Goal) -> str:
        """Return a sentence if no joint configuration within the limits reaches a goal, else ""."""
        return self.planner.describe_unreachable(goal)

    def plan(self, goal: Goal | str, task: Task = Task()) -> Plan[M]:
        """Begin to plan a motion from the current position to a goal, or to a named pose of the cell file.

        A plan that `plan_ahead` began is continued.

        Raises:
            Fault: The arm is moving, or the cell file has no such pose.
        """
        self._require_rest("plan a motion")
        is_planned_ahead = (self._end_q.tobytes(), goal, task) == self._stored_query
        plan = self._store_plan(goal, task)
        self._stored_query = self._stored_plan = None
        request_time = self._clock.now

        def report() -> None:
            duration = 0.0 if plan.future.exception() else plan.future.result().duration
            delay = self._clock.now - request_time
            self._emit(MotionPlanned(is_planned_ahead, round(delay, 4), round(duration, 4)))

        plan.report = report
        return plan

    def plan_ahead(self, goal: Goal | str, task: Task = Task()) -> None:
        """Plan the next motion, from the end of the running motion, before `plan` requests it.

        Raises:
            Fault: The cell file has no such pose.
        """
        self._store_plan(goal, task)

    def close(self) -> None:
        """Cancel the plans that have not started, wait for the running plan, and end the planning thread."""
        self._worker.shutdown(cancel_futures=True)

    def _store_plan(self, goal: Goal | str, task: Task) -> Plan[M]:
        """Return the stored plan from the end of the running motion; begin and store it if there is none."""
        if isinstance(goal, str) and goal not in self.poses:
            raise Fault(f'the cell file has no arm pose "{goal}"; it has {", ".join(sorted(self.poses))}')
        start = self._end_q.copy()
        query = start.tobytes(), goal, task
        if self._stored_plan is None or query != self._stored_query:
            if self._stored_plan is not None:
                # A plan that the worker has already started cannot be cancelled, but nobody reads its result.
                self._stored_plan.future.cancel()
            ready_time = self._clock.now + self._planning_time
            future = self._worker.submit(self._plan_motion, start, goal, task)
            self._stored_query = query
            self._stored_plan = Plan(self._clock, ready_time, future)
        return self._stored_plan

    def _require_rest(self, action: str) -> None:
        if not self.at_rest:
            raise Fault(f"the arm cannot {action} while moving; wait for `at_rest`")

    def _require_own_motion(self, motion: Motion, kind: type[M]) -> M:
        """Return the motion.

        Raises:
            Fault: The arm is moving, or did not plan the motion.
        """
        self._require_rest("start a motion")
        reject_generator(motion)
        if not isinstance(motion, kind):
            raise Fault(f"the arm follows its own planned motions, not a {type(motion).__name__}")
        return motion
