"""Replay of recorded inputs, and a work cell that replays and then may continue on its inner cell."""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import replace
from typing import Any

from executive import errors
from executive.cell.protocols import StepClock
from executive.cell.proxy import Access, intercept
from executive.cell.workcell import CellWrapper, Workcell
from executive.events import InputRead
from executive.replay.codecs import IDENTITY, Codec
from executive.replay.input_log import Halt, InputLog, Interruption
from executive.replay.recording_cell import RECORDED_ROLES, find_input_format


class InputNotRecorded(errors.Fault):
    """The replayed run reads an input that the recorded run had not read up to this control step."""


class InputReplayer:
    """Source of recorded values, which returns each value in the control step in which it was recorded.

    Args:
        log: The recorded inputs.

    Attributes:
        missing_input_message: Message about the first input without a recorded value, or "".
    """

    def __init__(self, log: InputLog) -> None:
        self._inputs = {name: deque(inputs) for name, inputs in log.inputs.items()}
        self._tick = 0
        self._read_counts: Counter[str] = Counter()
        # The journal of a killed run may contain no value of the clock; every clock starts at 0.
        self._last_values: dict[str, Any] = {"clock": 0.0}
        self.missing_input_message = ""

    def begin_step(self, tick: int) -> None:
        """Begin the control step number `tick`: set the number of reads of each input to 0."""
        self._tick = tick
        self._read_counts.clear()

    def read(self, name: str, codec: Codec = IDENTITY) -> Any:
        """Return the recorded value of an input.

        Args:
            name: Name of the input.
            codec: Codec of the value.

        Raises:
            InputNotRecorded: The recorded run had not read this input up to this control step.
            Exception: The recorded read raised an exception with the same class name and message.
        """
        self._read_counts[name] += 1
        inputs = self._inputs.get(name, deque())
        # Process all recorded values up to and including this read, in the order of their reads.
        this_read = (self._tick, self._read_counts[name])
        while inputs and (inputs[0].tick, inputs[0].reading.read_number) <= this_read:
            reading = inputs.popleft().reading
            if reading.exception:
                raise _make_exception(reading)
            self._last_values[name] = reading.value
        if name not in self._last_values:
            message = f"the replay reads {name} in step {self._tick}, but the journal has no earlier value"
            self.missing_input_message = self.missing_input_message or message
            raise InputNotRecorded(message)
        return codec.decode(self._last_values[name])


class ReplayedCell(CellWrapper):
    """Work cell that returns recorded inputs and ignores commands, up to the last interruption of the run.

    After the last interruption, all reads and commands go to the inner cell. The ledger is always the ledger
    of the inner cell.

    Args:
        inner: Cell on which the run continues after the last interruption.

    Attributes:
        log: Recorded inputs before the last interruption.
        last_interruption: Interruption at the end of the log, or None if the run is only replayed.
        pending_interruption: Interruption at this control step; None after `resume`, or without interruption.
        is_live: True if all reads and commands go to the inner cell.
    """

    def __init__(self, inner: Workcell, log: InputLog, last_interruption: Interruption | None = None) -> None:
        super().__init__(inner)
        step_count = None if last_interruption is None else last_interruption.kept_step_count
        self.log = log if step_count is None else log.select_before(step_count)
        self.last_interruption = last_interruption
        self._replayer = InputReplayer(self.log)
        self._has_raised_stop = False
        self.is_live = False
        clock = StepClock(self._read_clock, self.log.control_period)
        self.cell = replace(intercept(inner.cell, self._handle_access, RECORDED_ROLES), clock=clock)
        self._begin_step(0)
        self.pending_interruption = self._make_final_interruption(0)

    @property
    def steps(self) -> int:
        """Number of control steps since the run began."""
        return self.inner.steps if self.is_live else self._steps

    @property
    def missing_input_message(self) -> str:
        """Message about the first input without a recorded value, or ""."""
        return self._replayer.missing_input_message

    @property
    def has_run_ended(self) -> bool:
        """True if the run is only replayed and was recorded to end before the tick of this control step."""
        return self.last_interruption is None and self.log.has_ended_before_tick(self._steps)

    @property
    def is_resumed_from_incomplete(self) -> bool:
        """True if the recorded run ended as INCOMPLETE in this control step, and was then resumed."""
        interruption = None if self.is_live else self._make_final_interruption(self._steps + 1)
        return interruption is not None and interruption.restarts_tree

    def resume(self) -> None:
        """Continue after the pending interruption; after the last interruption, continue on the inner cell.

        If the inner cell has executed fewer control steps than the log contains, it executes the rest first.
        """
        interruption, self.pending_interruption = self.pending_interruption, None
        assert interruption is not None, "only an interrupted run can be resumed"
        if interruption is not self.last_interruption:
            self._begin_step(interruption.resume_tick)
            return
        while self.inner.steps < interruption.kept_step_count:
            self.inner.advance()
        self.is_live = True

    def advance(self) -> None:
        """Execute one control step.

        Raises:
            Stopped: The recorded run was halted in this control step; raised only once.
        """
        if self.is_live:
            self.inner.advance()
            return
        is_halted = self.last_interruption is None and self.log.halt == Halt(self._steps, is_tree_ticked=True)
        if is_halted and not self._has_raised_stop:
            self._has_raised_stop = True
            raise errors.Stopped("the recorded run was halted in this control step")
        self._begin_step(self._steps + 1)
        self.pending_interruption = self._make_final_interruption(self._steps)

    def _begin_step(self, step_count: int) -> None:
        self._steps = step_count
        self._replayer.begin_step(step_count)

    def _make_final_interruption(self, step_count: int) -> Interruption | None:
        """Return the interruption after `step_count` control steps, or None."""
        if self.last_interruption is not None and step_count == self.last_interruption.kept_step_count:
            return self.last_interruption
        return self.log.interruptions.get(step_count)

    def _read_clock(self) -> float:
        """Return the time on the clock of the cell [s]."""
        if self.is_live:
            return self.inner.cell.clock.now
        offset: float = self._replayer.read("clock")
        return self._steps * self.log.control_period + offset

    def _handle_access(self, access: Access) -> Any:
        """Return the recorded result of an access to the cell, or the result from the inner cell."""
        if self.is_live:
            return access.proceed()
        return self._replayer.read(*find_input_format(access))


def _make_exception(reading: InputRead) -> BaseException:
    """Return an exception with the recorded class name and message; an unknown class is created."""
    exception_class = getattr(errors, reading.exception, None) or type(reading.exception, (Exception,), {})
    error = exception_class(reading.value)
    assert isinstance(error, BaseException)
    return error
