"""Recorded inputs of a run, and the progress of their replay up to the resumption of the run."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

from executive.errors import Stopped
from executive.events import InputRead, RunEnded, RunHalted, RunResumed, RunStarted, TimedEvent, ToolCommanded
from executive.station.border import RecordedInput
from executive.station.station import Station


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
        """Time between two ticks [s]."""
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


class Replay:
    """Progress of the replay of a recorded run, up to the last interruption of the run.

    Until then, the border of the station returns recorded values and executes no commands. After the last
    interruption, the run continues on the devices of the station.

    Args:
        station: Station of the replaying run.
        log: Recorded inputs.
        last_interruption: Interruption at the end of the log, or None if the run is only replayed.

    Attributes:
        log: Recorded inputs before the last interruption.
        tick: Number of the current tick.
        last_interruption: Interruption at the end of the log, or None if the run is only replayed.
        pending_interruption: Interruption at this tick; None after `resume`, or without interruption.
    """

    def __init__(
        self, station: Station, log: InputLog, last_interruption: Interruption | None = None
    ) -> None:
        kept_count = None if last_interruption is None else last_interruption.kept_step_count
        self.log = log if kept_count is None else log.select_before(kept_count)
        self.tick = 0
        self.last_interruption = last_interruption
        self._station = station
        self._has_raised_stop = False
        self.pending_interruption = self._find_interruption(0)
        station.border.replay(self.log.inputs)

    @property
    def is_live(self) -> bool:
        """True if the run continues on the devices."""
        return self._station.border.is_live

    @property
    def has_run_ended(self) -> bool:
        """True if the run is only replayed and was recorded to end before this tick."""
        return self.last_interruption is None and self.log.has_ended_before_tick(self.tick)

    @property
    def is_resumed_from_incomplete(self) -> bool:
        """True if the recorded run ended as INCOMPLETE in this tick, and was then resumed."""
        interruption = None if self.is_live else self._find_interruption(self.tick + 1)
        return interruption is not None and interruption.restarts_tree

    def resume(self) -> None:
        """Continue after the pending interruption; after the last interruption, continue on the devices.

        If the devices have executed fewer ticks than the log contains, they execute the rest first.
        """
        interruption = self.pending_interruption
        self.pending_interruption = None
        assert interruption is not None, "only an interrupted run can be resumed"
        if interruption is not self.last_interruption:
            self.tick = interruption.resume_tick
            return
        while self._station.tick_count < interruption.kept_step_count:
            self._station.advance()
        self._station.border.is_live = True

    def advance(self) -> None:
        """Continue with the next tick of the record.

        Raises:
            Stopped: The recorded run was halted in this tick; raised only once.
        """
        is_halted = self.last_interruption is None and self.log.halt == Halt(self.tick, is_tree_ticked=True)
        if is_halted and not self._has_raised_stop:
            self._has_raised_stop = True
            raise Stopped("the recorded run was halted in this control step")
        self.tick += 1
        self.pending_interruption = self._find_interruption(self.tick)

    def _find_interruption(self, tick_count: int) -> Interruption | None:
        """Return the interruption after `tick_count` ticks, or None."""
        if self.last_interruption is not None and tick_count == self.last_interruption.kept_step_count:
            return self.last_interruption
        return self.log.interruptions.get(tick_count)
