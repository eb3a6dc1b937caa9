"""Plans that take their time on the run's clock, although they are made at once."""

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
"""The kind of motion that an arm follows."""


@dataclass(frozen=True, eq=False)
class Plan(Generic[M]):
    """A motion being planned; implements `executive.cell.arm.Planning`.

    Attributes:
        due: When it is known [s].
    """

    clock: Clock
    due: float
    outcome: M | Unreachable | Blocked

    @property
    def ready(self) -> bool:
        """True from the tick at which it is known, on the run's clock."""
        return self.clock.now >= self.due - self.clock.step / 2

    def result(self) -> M:
        """Return the motion.

        Raises:
            Unreachable: The goal has no joint solution inside the limits.
            Blocked: Every way comes too close to something.
        """
        if isinstance(self.outcome, Exception):
            raise self.outcome
        return self.outcome


class Plans(Generic[M]):
    """Makes plans, one ahead at a time, and tells the run how long each was waited for.

    Args:
        solve: Plans a motion from where an arm rests `(N,)`; raises Unreachable and Blocked.
        clock: The run's.
        latency: Time that a plan takes on it [s].
        emit: Tells the run what happens.
    """

    def __init__(
        self, solve: Callable[[Array, Goal | str, Task], M], clock: Clock, latency: float, emit: Emit
    ) -> None:
        self._solve = solve
        self._clock = clock
        self._latency = latency
        self._emit = emit
        self._ahead: tuple[bytes, Goal | str, Task] | None = None
        self._plan: Plan[M] | None = None

    def ahead(self, start: Array, goal: Goal | str, task: Task) -> None:
        """Plan a motion from `start` `(N,)` for whoever asks the same question next."""
        question = start.tobytes(), goal, task
        if question != self._ahead:
            self._ahead, self._plan = question, self._made(start, goal, task)

    def now(self, start: Array, goal: Goal | str, task: Task) -> Plan[M]:
        """Return the plan of a motion from `start` `(N,)`, begun now unless it was planned ahead."""
        found = self._plan if (start.tobytes(), goal, task) == self._ahead else None
        plan = found or self._made(start, goal, task)
        self._ahead = self._plan = None
        duration = 0.0 if isinstance(plan.outcome, Exception) else plan.outcome.duration
        waits = max(0.0, plan.due - self._clock.now)
        self._emit(MotionPlanned(found is not None, round(waits, 4), round(duration, 4)))
        return plan

    def _made(self, start: Array, goal: Goal | str, task: Task) -> Plan[M]:
        outcome: M | Unreachable | Blocked
        try:
            outcome = self._solve(start, goal, task)
        except (Unreachable, Blocked) as error:
            outcome = error
        return Plan(self._clock, self._clock.now + self._latency, outcome)
