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
from executive.replay.recorded_cell import MOVING_COMMANDS, RECORDED_ROLES, InputFormat


class ReplayedCell(CellWrapper):
    """Answers as the recorded run was answered; the cell inside is used only for its ledger.

    With a `last` interruption, the cell inside takes over after it: then all questions and commands go to the
    cell inside.

    Args:
        inner: The cell inside.
        log: The recorded inputs.
        last: Interruption at the end of the log, or None to replay only.

    Attributes:
        log: The recorded inputs that are replayed: those before the last interruption.
        last: Interruption at the end of the log, or None.
        interruption: Interruption before this control step after which the run was not resumed yet, or None.
        is_live: True from the moment at which the cell inside has taken over.
    """

    def __init__(self, inner: Workcell, log: InputLog, last: Interruption | None = None) -> None:
        super().__init__(inner)
        self.log = log if last is None else log.before(last.complete)
        self.last = last
        self._replayer = InputReplayer(self.log)
        self._is_halted = False
        self._last_command = 0
        self.is_live = False
        clock = StepClock(self._now, self.log.step)
        self._cell = replace(intercept(inner.cell, self._answer, RECORDED_ROLES), clock=clock)
        self._begin_step(0)
        self.interruption = self._interruption_at(0)

    @property
    def cell(self) -> Cell:
        """The cell that skills see."""
        return self._cell

    @property
    def steps(self) -> int:
        """Number of control steps since the run began."""
        return self.inner.steps if self.is_live else self._steps

    @property
    def last_command(self) -> int:
        """Control step of the last command to arm or tool; of a recorded run, as far as the log reaches."""
        return self.inner.last_command if self.is_live else self._last_command

    @property
    def unanswered(self) -> str:
        """Message of the first question without a recorded answer, or ""."""
        return self._replayer.unanswered

    @property
    def is_over(self) -> bool:
        """True if the recorded run ended before its tree was ticked in this control step."""
        return self.last is None and self.log.is_over(self._steps)

    @property
    def is_reopened(self) -> bool:
        """True if the recorded run ended in this control step as INCOMPLETE and was resumed."""
        following = None if self.is_live else self._interruption_at(self._steps + 1)
        return following is not None and following.reopens

    def resume(self) -> None:
        """Continue after the interruption; after the last one, the cell inside takes over.

        The cell inside first makes the control steps that it lacks.
        """
        interruption, self.interruption = self.interruption, None
        assert interruption is not None, "only an interrupted run can be resumed"
        if interruption is not self.last:
            self._begin_step(interruption.resumed)
            return
        while self.inner.steps < interruption.complete:
            self.inner.advance()
        self.is_live = True

    @contextmanager
    def muted(self) -> Iterator[None]:
        """Answer with the last recorded answers meanwhile; no command has an effect."""
        is_live, self.is_live = self.is_live, False
        try:
            yield
        finally:
            self.is_live = is_live

    def advance(self) -> None:
        """Let one control step pass.

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
        self.interruption = self._interruption_at(self._steps)

    def _begin_step(self, steps: int) -> None:
        self._steps = steps
        self._replayer.begin_step(steps)

    def _interruption_at(self, steps: int) -> Interruption | None:
        if self.last is not None and steps == self.last.complete:
            return self.last
        return self.log.interruptions.get(steps)

    def _now(self) -> float:
        if self.is_live:
            return self.inner.cell.clock.now
        ahead: float = self._replayer.read("clock")
        return self._steps * self.log.step + ahead

    def _answer(self, access: Access) -> Any:
        if self.is_live:
            return access.proceed()
        if access.name in MOVING_COMMANDS and self._steps <= self.log.last_tick:
            self._last_command = self._steps
        name, codec = InputFormat.of(access)
        return self._replayer.read(name, codec)
