"""Replay of recorded inputs and interruptions by a cell that then may continue on its inner cell."""

from __future__ import annotations

from collections import Counter, defaultdict, deque
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from executive import errors
from executive.cell.protocols import StepClock
from executive.cell.proxy import Access, intercept
from executive.cell.workcell import CellWrapper, Workcell
from executive.events import InputRead, RunEnded, RunHalted, RunResumed, RunStarted, TimedEvent, ToolCommanded
from executive.replay.recording_cell import IDENTITY, RECORDED_ROLES, Codec, find_input_format


class RecordedInput(NamedTuple):
    """Event with a value that a run read from its cell, and number of the control step of the reading."""

    tick: int
    reading: InputRead


@dataclass(frozen=True)
class Interruption:
    """Interruption of a run between the end of one process and the resumption in another process.

    Attributes:
        kept_step_count: Number of control steps before the interruption that the resumed run keeps.
        last_action: Last action of the tool, `open` or `close`; "" without an action.
        restarts_tree: True if the run ended as INCOMPLETE; the resumption then restarts the tree.
        resume_tick: First control step after the resumption.
    """

    kept_step_count: int
    last_action: str
    restarts_tree: bool
    resume_tick: int


class Halt(NamedTuple):
    """Halt in step `tick`; `is_tree_ticked` is True if the tree was ticked in this step before the halt."""

    tick: int
    is_tree_ticked: bool


class InputLog:
    """Recorded inputs and interruptions of a run.

    Args:
        events: Events of a journal.

    Attributes:
        events: Events of the journal in order, without the control steps that a resumption discarded.
        inputs: Recorded values by name of the input, in order; equal consecutive values are recorded once.
        interruptions: Interruptions after which the run was resumed, by `kept_step_count`.
        halt: The last halt, or None.
        last_tick: Number of the last control step with an event.
        last_action: Last action of the tool, `open` or `close`; "" without an action.
    """

    def __init__(self, events: Iterable[TimedEvent]) -> None:
        self.events: list[TimedEvent] = []
        for timed in events:
            if isinstance(timed.event, RunResumed):
                self.events = _select_before(self.events, timed.event.valid_ticks)
            self.events.append(timed)
        self.inputs: dict[str, list[RecordedInput]] = defaultdict(list)
        self.interruptions: dict[int, Interruption] = {}
        self.halt: Halt | None = None
        self.last_tick = 0
        self.last_action = ""
        self._incomplete_end_ticks: set[int] = set()
        for timed in self.events:
            tick = timed.tick
            event = timed.event
            self.last_tick = max(self.last_tick, tick)
            match event:
                case RunResumed(count, action):
                    restarts_tree = count - 1 in self._incomplete_end_ticks
                    self.interruptions[count] = Interruption(count, action, restarts_tree, tick)
                case InputRead(name):
                    self.inputs[name].append(RecordedInput(tick, event))
                case RunHalted(is_tree_ticked):
                    self.halt = Halt(tick, is_tree_ticked)
                case ToolCommanded(action):
                    self.last_action = action
                case RunEnded(status="INCOMPLETE"):
                    self._incomplete_end_ticks.add(tick)

    @property
    def start_event(self) -> RunStarted | None:
        """First event of the run, or None if the run was interrupted before this event."""
        return next((timed.event for timed in self.events if isinstance(timed.event, RunStarted)), None)

    @property
    def control_period(self) -> float:
        """Duration of a control step [s]."""
        assert self.start_event is not None, "the journal of a replayed run contains its start"
        return self.start_event.step

    def find_lost_value(self) -> str:
        """Return a clause about the first output or present blackboard value that is not in the journal."""
        readings = (timed.event for timed in self.events if isinstance(timed.event, InputRead))
        values: list[Any] = [each.value for each in readings if each.name.startswith("behaviour.")]
        steps = [value["values"] for value in values if isinstance(value, dict)]
        for step in steps:
            for key, entry in step.items():
                # A step contains all values on the blackboard, whose keys begin with a slash.
                is_present = step is steps[-1] or not key.startswith("/")
                if is_present and isinstance(entry, str):
                    return f'JSON cannot restore the value of "{key}" ({entry})'
        return ""

    def make_final_interruption(self, step_count: int, *, is_complete: bool = True) -> Interruption:
        """Return the interruption between the end of the log and the next resumption.

        A run that ended as INCOMPLETE keeps all control steps. Otherwise, the kept steps are in the log and
        were executed by the cell. Steps in which the arm only braked are discarded: the steps after a halt,
        and the steps of a resumption that was interrupted before the tree was ticked again.

        Args:
            step_count: Number of control steps that the cell has executed.
            is_complete: True if the log contains all events of its last control step.
        """
        if self.last_tick in self._incomplete_end_ticks:
            return Interruption(self.last_tick + 1, self.last_action, True, self.last_tick + 1)
        logged_count = self.last_tick + 1 if is_complete else self.last_tick
        kept_count = min(step_count, logged_count if self.halt is None else self.halt.tick)
        for interruption in reversed(self.interruptions.values()):
            if interruption.resume_tick >= kept_count:
                kept_count = min(kept_count, interruption.kept_step_count)
        restarts_tree = kept_count - 1 in self._incomplete_end_ticks
        return Interruption(kept_count, self.last_action, restarts_tree, step_count)

    def has_ended_before_tick(self, tick: int) -> bool:
        """Return True if the recorded run ended before its tree was ticked in control step `tick`."""
        return tick > self.last_tick if self.halt is None else self.halt == (tick, False)

    def select_before(self, tick: int) -> InputLog:
        """Return the log of the events before control step `tick`, including the start of the run."""
        return InputLog(_select_before(self.events, tick))


def _select_before(events: Iterable[TimedEvent], tick: int) -> list[TimedEvent]:
    """Return the events before control step `tick`, including the start of the run."""
    return [timed for timed in events if timed.tick < tick or isinstance(timed.event, RunStarted)]


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
        replayer: Source of the recorded values.
        last_interruption: Interruption at the end of the log, or None if the run is only replayed.
        pending_interruption: Interruption at this control step; None after `resume`, or without interruption.
        is_live: True if all reads and commands go to the inner cell.
    """

    def __init__(self, inner: Workcell, log: InputLog, last_interruption: Interruption | None = None) -> None:
        super().__init__(inner)
        step_count = None if last_interruption is None else last_interruption.kept_step_count
        self.log = log if step_count is None else log.select_before(step_count)
        self.last_interruption = last_interruption
        self.replayer = InputReplayer(self.log)
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
        interruption = self.pending_interruption
        self.pending_interruption = None
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
        self.replayer.begin_step(step_count)

    def _make_final_interruption(self, step_count: int) -> Interruption | None:
        """Return the interruption after `step_count` control steps, or None."""
        if self.last_interruption is not None and step_count == self.last_interruption.kept_step_count:
            return self.last_interruption
        return self.log.interruptions.get(step_count)

    def _read_clock(self) -> float:
        """Return the time on the clock of the cell [s]."""
        if self.is_live:
            return self.inner.cell.clock.now
        offset: float = self.replayer.read("clock")
        return self._steps * self.log.control_period + offset

    def _handle_access(self, access: Access) -> Any:
        """Return the recorded result of an access to the cell, or the result from the inner cell."""
        return access.proceed() if self.is_live else self.replayer.read(*find_input_format(access))


def _make_exception(reading: InputRead) -> BaseException:
    """Return an exception with the recorded class name and message; an unknown class is created."""
    exception_class = getattr(errors, reading.exception, None) or type(reading.exception, (Exception,), {})
    error = exception_class(reading.value)
    assert isinstance(error, BaseException)
    return error
