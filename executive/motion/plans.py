"""Motion plans that a worker thread computes, and that become ready after the planning time of the cell."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Generic, TypeVar

from executive.cell.arm import Goal, Motion, Task
from executive.cell.futures import wait_until_done
from executive.cell.protocols import Clock
from executive.events import Emit, MotionPlanned
from executive.geometry import Array

M = TypeVar("M", bound=Motion)
"""Type of the motions of an arm."""


@dataclass(eq=False)
class Plan(Generic[M]):
    """Planning of a motion, in progress or finished; implements `executive.cell.arm.Planning`.

    Attributes:
        clock: Clock of the run.
        ready_time: Time before which the plan is not ready [s].
        future: Planned motion, or exception of the planner, from the worker thread.
        is_realtime: True if the clock of the run does not wait for the worker thread.
        report: Function that is called once when the plan is ready, or None.
    """

    clock: Clock
    ready_time: float
    future: Future[M]
    is_realtime: bool
    report: Callable[[], None] | None = None

    @property
    def ready(self) -> bool:
        """True if the time `ready_time` has come and, in real time, the worker has finished.

        In simulation, this property waits for the worker at `ready_time`, so that the time at which a motion
        becomes available does not depend on the speed of the computer. If the plan is ready, the first read
        of the property calls `report`.
        """
        if self.clock.now < self.ready_time - self.clock.step / 2:
            return False
        if not self.is_realtime:
            wait_until_done(self.future)
        if self.report is not None and self.future.done():
            report, self.report = self.report, None
            report()
        return self.future.done()

    def result(self) -> M:
        """Return the motion.

        Raises:
            Unreachable: The goal has no joint solution inside the limits.
            Blocked: Every candidate comes too close to an obstacle.
        """
        return self.future.result()


class PlanFactory(Generic[M]):
    """Makes plans in a worker, stores at most one plan for a later request, and emits events.

    Args:
        submit: Function that begins to plan a motion from joint positions at rest, for instance in a worker.
        clock: Clock of the run.
        planning_time: Time from the request of a plan until the plan is ready [s].
        emit: Function that receives an event for each requested plan when the plan is ready.
        is_realtime: True if the clock of the run does not wait for the worker thread.
    """

    def __init__(
        self,
        submit: Callable[[Array, Goal | str, Task], Future[M]],
        clock: Clock,
        planning_time: float,
        emit: Emit,
        *,
        is_realtime: bool = False,
    ) -> None:
        self._submit = submit
        self._clock = clock
        self._planning_time = planning_time
        self._emit = emit
        self._is_realtime = is_realtime
        self._stored_query: tuple[bytes, Goal | str, Task] | None = None
        self._stored_plan: Plan[M] | None = None

    def plan_ahead(self, start: Array, goal: Goal | str, task: Task) -> Plan[M]:
        """Plan a motion from `start` `(n,)` [rad], and store the plan for a later call of `plan`."""
        query = start.tobytes(), goal, task
        if self._stored_plan is None or query != self._stored_query:
            if self._stored_plan is not None:
                # A plan that the worker has already started cannot be cancelled, but nobody reads its result.
                self._stored_plan.future.cancel()
            ready_time = self._clock.now + self._planning_time
            future = self._submit(start.copy(), goal, task)
            self._stored_query = query
            self._stored_plan = Plan(self._clock, ready_time, future, self._is_realtime)
        return self._stored_plan

    def plan(self, start: Array, goal: Goal | str, task: Task) -> Plan[M]:
        """Return the plan of a motion from `start` `(n,)` [rad], if possible the plan of `plan_ahead`."""
        is_planned_ahead = (start.tobytes(), goal, task) == self._stored_query
        plan = self.plan_ahead(start, goal, task)
        self._stored_query = self._stored_plan = None
        request_time, future = self._clock.now, plan.future

        def report() -> None:
            duration = 0.0 if future.exception() else future.result().duration
            delay = self._clock.now - request_time
            self._emit(MotionPlanned(is_planned_ahead, round(delay, 4), round(duration, 4)))

        plan.report = report
        return plan
