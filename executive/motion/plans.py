"""Plans that are computed at once, and known after the planning time on the clock of the run."""

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
    """A motion in planning; implements `executive.cell.arm.Planning`.

    Attributes:
        clock: Clock of the run.
        due: Time at which the outcome is known [s].
        outcome: The motion, or the error of the planner.
    """

    clock: Clock
    due: float
    outcome: M | Unreachable | Blocked

    @property
    def ready(self) -> bool:
        """True from the control step at the time `due`."""
        return self.clock.now >= self.due - self.clock.step / 2

    def result(self) -> M:
        """Return the motion.

        Raises:
            Unreachable: The goal has no joint solution inside the limits.
            Blocked: Every path comes too close to an obstacle.
        """
        if isinstance(self.outcome, Exception):
            raise self.outcome
        return self.outcome


class Plans(Generic[M]):
    """Makes the plans of an arm, at most one of them ahead, and emits an event for each requested plan.

    Args:
        solve: Plans a motion from joint positions at rest `(n,)` [rad]; raises Unreachable and Blocked.
        clock: Clock of the run.
        latency: Time for planning a motion on the clock of the run [s].
        emit: Emits an event.
    """

    def __init__(
        self, solve: Callable[[Array, Goal | str, Task], M], clock: Clock, latency: float, emit: Emit
    ) -> None:
        self._solve = solve
        self._clock = clock
        self._latency = latency
        self._emit = emit
        self._query_ahead: tuple[bytes, Goal | str, Task] | None = None
        self._plan_ahead: Plan[M] | None = None

    def plan_ahead(self, start: Array, goal: Goal | str, task: Task) -> None:
        """Plan a motion from `start` `(n,)` [rad] before the motion is requested."""
        query = start.tobytes(), goal, task
        if query != self._query_ahead:
            self._query_ahead, self._plan_ahead = query, self._plan(start, goal, task)

    def plan(self, start: Array, goal: Goal | str, task: Task) -> Plan[M]:
        """Return the plan of a motion from `start` `(n,)` [rad], which may have been planned ahead."""
        ahead = self._plan_ahead if (start.tobytes(), goal, task) == self._query_ahead else None
        plan = ahead or self._plan(start, goal, task)
        self._query_ahead = self._plan_ahead = None
        duration = 0.0 if isinstance(plan.outcome, Exception) else plan.outcome.duration
        wait_time = max(0.0, plan.due - self._clock.now)
        self._emit(MotionPlanned(ahead is not None, round(wait_time, 4), round(duration, 4)))
        return plan

    def _plan(self, start: Array, goal: Goal | str, task: Task) -> Plan[M]:
        outcome: M | Unreachable | Blocked
        try:
            outcome = self._solve(start, goal, task)
        except (Unreachable, Blocked) as error:
            outcome = error
        return Plan(self._clock, self._clock.now + self._latency, outcome)
