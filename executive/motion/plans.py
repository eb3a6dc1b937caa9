"""Motion plans that are computed immediately and become ready after the planning time of the cell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from executive.cell.arm import Goal, Motion, Task
from executive.cell.protocols import Clock
from executive.errors import Blocked, Unreachable
from executive.events import Emit, MotionPlanned
from executive.geometry import Array

M = TypeVar("M", bound=Motion)
"""Type of the motions of an arm."""


@dataclass(frozen=True, eq=False)
class Plan(Generic[M]):
    """Planning of a motion, in progress or finished; implements `executive.cell.arm.Planning`.

    Attributes:
        clock: Clock of the run.
        ready_time: Time at which the planning is finished [s].
        outcome: Planned motion, or error of the planner.
    """

    clock: Clock
    ready_time: float
    outcome: M | Unreachable | Blocked

    @property
    def ready(self) -> bool:
        """True from the control step at `ready_time`."""
        return self.clock.now >= self.ready_time - self.clock.step / 2

    def result(self) -> M:
        """Return the motion.

        Raises:
            Unreachable: The goal has no joint solution inside the limits.
            Blocked: Every candidate comes too close to an obstacle.
        """
        if isinstance(self.outcome, Exception):
            raise self.outcome
        return self.outcome


class PlanFactory(Generic[M]):
    """Makes plans, stores at most one plan for a later request, and emits an event for each request.

    Args:
        plan: Function that plans a motion from joint positions at rest; raises Unreachable and Blocked.
        clock: Clock of the run.
        planning_time: Time from the request of a plan until the plan is ready [s].
        emit: Function that receives the events.
    """

    def __init__(
        self, plan: Callable[[Array, Goal | str, Task], M], clock: Clock, planning_time: float, emit: Emit
    ) -> None:
        self._plan_motion, self._planning_time = plan, planning_time
        self._clock, self._emit = clock, emit
        self._stored_query: tuple[bytes, Goal | str, Task] | None = None
        self._stored_plan: Plan[M] | None = None

    def plan_ahead(self, start: Array, goal: Goal | str, task: Task) -> None:
        """Plan a motion from `start` `(n,)` [rad], and store the plan for a later call of `plan`."""
        query = start.tobytes(), goal, task
        if query != self._stored_query:
            self._stored_query, self._stored_plan = query, self._make_plan(start, goal, task)

    def plan(self, start: Array, goal: Goal | str, task: Task) -> Plan[M]:
        """Return the plan of a motion from `start` `(n,)` [rad], if possible the plan of `plan_ahead`."""
        is_stored = (start.tobytes(), goal, task) == self._stored_query
        stored_plan = self._stored_plan if is_stored else None
        plan = stored_plan or self._make_plan(start, goal, task)
        self._stored_query = self._stored_plan = None
        duration = 0.0 if isinstance(plan.outcome, Exception) else plan.outcome.duration
        wait_time = max(0.0, plan.ready_time - self._clock.now)
        self._emit(MotionPlanned(is_stored, round(wait_time, 4), round(duration, 4)))
        return plan

    def _make_plan(self, start: Array, goal: Goal | str, task: Task) -> Plan[M]:
        """Return the plan of a motion, which becomes ready after the planning time."""
        outcome: M | Unreachable | Blocked
        try:
            outcome = self._plan_motion(start, goal, task)
        except (Unreachable, Blocked) as error:
            outcome = error
        return Plan(self._clock, self._clock.now + self._planning_time, outcome)
