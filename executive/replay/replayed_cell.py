"""Work cell that replays recorded inputs, and may continue on the real cell."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from executive.cell.cell_wrapper import CellWrapper
from executive.cell.clock import StepClock
from executive.cell.protocols import Cell
from executive.cell.proxy import Access, intercept
from executive.cell.workcell import Workcell
from executive.errors import Stopped
from executive.replay.input_log import InputLog, Interruption
from executive.replay.input_replayer import InputReplayer
from executive.replay.recorded_cell import RECORDED_ROLES, InputFormat


class ReplayedCell(CellWrapper):
    """Answers queries with the recorded answers; the inner cell is used only for its ledger.

    With a `last` interruption, all queries and commands after this interruption go to the inner cell.

    Args:
        inner: The inner cell.
        log: The recorded inputs.
        last: Interruption at the end of the log, or None to replay only.

    Attributes:
        log: The recorded inputs that are replayed: those before the last interruption.
        last: Interruption at the end of the log, or None.
        interruption: Interruption before this control step, until the run is resumed; else None.
        is_live: True if all queries and commands go to the inner cell.
    """

    def __init__(self, inner: Workcell, log: InputLog, last: Interruption | None = None) -> None:
        super().__init__(inner)
        self.log = log if last is None else log.select_before(last.complete_steps)
        self.last = last
        self._replayer = InputReplayer(self.log)
        self._is_halted = False
        self.is_live = False
        clock = StepClock(self._now, self.log.step)
        self._cell = replace(intercept(inner.cell, self._answer, RECORDED_ROLES), clock=clock)
        self._begin_step(0)
        self.interruption = self._find_interruption(0)

    @property
    def cell(self) -> Cell:
        """The cell that skills see."""
        return self._cell

    @property
    def steps(self) -> int:
        """Number of control steps since the run began."""
        return self.inner.steps if self.is_live else self._steps

    @property
    def unanswered(self) -> str:
        """Message of the first query without a recorded answer, or ""."""
        return self._replayer.unanswered

    @property
    def is_over(self) -> bool:
        """True if the recorded run ended before its tree was ticked in this control step."""
        return self.last is None and self.log.is_over(self._steps)

    @property
    def is_tree_restarted(self) -> bool:
        """True if the recorded run ended in this control step as INCOMPLETE and was resumed."""
        next_interruption = None if self.is_live else self._find_interruption(self._steps + 1)
        return next_interruption is not None and next_interruption.restarts_tree

    def resume(self) -> None:
        """Continue after the interruption; after the last interruption, on the inner cell.

        The inner cell first makes the control steps that it lacks.
        """
        interruption, self.interruption = self.interruption, None
        assert interruption is not None, "only an interrupted run can be resumed"
        if interruption is not self.last:
            self._begin_step(interruption.resumed_at)
            return
        while self.inner.steps < interruption.complete_steps:
            self.inner.advance()
        self.is_live = True

    @contextmanager
    def suppress_commands(self) -> Iterator[None]:
        """Answer with the last recorded answers in the `with` block; commands have no effect there."""
        is_live, self.is_live = self.is_live, False
        try:
            yield
        finally:
            self.is_live = is_live

    def advance(self) -> None:
        """Make one control step.

        Raises:
            Stopped: The recorded run was halted in this step; raised once.
        """
        if self.is_live:
            self.inner.advance()
            return
        if self.last is None and not self._is_halted and self.log.is_halted_after_tick(self._steps):
            self._is_halted = True
            raise Stopped("the recorded run was halted here")
        self._begin_step(self._steps + 1)
        self.interruption = self._find_interruption(self._steps)

    def _begin_step(self, steps: int) -> None:
        self._steps = steps
        self._replayer.begin_step(steps)

    def _find_interruption(self, steps: int) -> Interruption | None:
        if self.last is not None and steps == self.last.complete_steps:
            return self.last
        return self.log.interruptions.get(steps)

    def _now(self) -> float:
        if self.is_live:
            return self.inner.cell.clock.now
        offset: float = self._replayer.read("clock")
        return self._steps * self.log.step + offset

    def _answer(self, access: Access) -> Any:
        if self.is_live:
            return access.proceed()
        name, codec = InputFormat.find(access)
        return self._replayer.read(name, codec)
