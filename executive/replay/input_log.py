"""Recorded inputs and interruptions of a run, from its journal."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from executive.events import (
    Event,
    InputRead,
    MotionPlanned,
    RunEnded,
    RunHalted,
    RunResumed,
    RunStarted,
    TimedEvent,
    ToolCommanded,
)

UNKNOWN_ACTION = "unknown"
"""Last action of the tool before an interruption, if the journal lacks it."""
_COMMANDS = (ToolCommanded, MotionPlanned)
"""Events that precede commands to tool and arm."""


class RecordedInput(NamedTuple):
    """A recorded answer of a cell.

    Attributes:
        tick: Control step in which the answer was read.
        answer: Event of the answer.
    """

    tick: int
    answer: InputRead


@dataclass(frozen=True)
class Interruption:
    """Time between the end of a process that executed a run, and the resumption of the run.

    Attributes:
        complete_steps: Number of control steps before the interruption that remain valid.
        last_action: Last action of the tool before the interruption, `open` or `close`; "" if there was none;
            `UNKNOWN_ACTION` if arm or tool did more than the journal knows.
        restarts_tree: True if the run had ended as INCOMPLETE, so that the tree starts again.
        resumed_at: Control step at which the run was resumed.
    """

    complete_steps: int
    last_action: str
    restarts_tree: bool
    resumed_at: int


class Halt(NamedTuple):
    """Halt of a run: its control step, and True if the tree was ticked in this step."""

    tick: int
    is_tree_ticked: bool


@dataclass(frozen=True)
class InputLog:
    """Inputs and interruptions of a run so far.

    Attributes:
        events: Events of the journal that no resumption made void, in order.
        inputs: Recorded answers by name of the input, in order, without repeated answers.
        interruptions: Interruptions by `Interruption.complete_steps`.
        halt: The last halt, or None.
    """

    events: Sequence[TimedEvent]
    inputs: Mapping[str, Sequence[RecordedInput]] = field(default_factory=dict)
    interruptions: Mapping[int, Interruption] = field(default_factory=dict)
    halt: Halt | None = None

    @staticmethod
    def from_events(events: Iterable[TimedEvent]) -> InputLog:
        """Return the log of the events of a journal.

        A resumption voids all earlier events from the first incomplete control step on.
        """
        valid: list[TimedEvent] = []
        for timed in events:
            if isinstance(timed.event, RunResumed):
                valid = _select_before(valid, timed.event.ticked)
            valid.append(timed)
        incomplete_ends = _find_incomplete_ends(valid)
        interruptions: dict[int, Interruption] = {}
        inputs: dict[str, list[RecordedInput]] = defaultdict(list)
        halt = None
        for timed in valid:
            tick, event = timed.tick, timed.event
            match event:
                case RunResumed(steps, action):
                    interruptions[steps] = Interruption(steps, action, steps - 1 in incomplete_ends, tick)
                case InputRead(name):
                    inputs[name].append(RecordedInput(tick, event))
                case RunHalted(is_tree_ticked):
                    halt = Halt(tick, is_tree_ticked)
        return InputLog(valid, inputs, interruptions, halt)

    @property
    def start(self) -> RunStarted | None:
        """Start of the run, or None if the run had not started."""
        return next((timed.event for timed in self.events if isinstance(timed.event, RunStarted)), None)

    @property
    def step(self) -> float:
        """Length of a control step [s]."""
        assert self.start is not None, "a run that is replayed has started"
        return self.start.step

    @property
    def last_tick(self) -> int:
        """Last control step with an event."""
        return max((timed.tick for timed in self.events), default=0)

    @property
    def last_action(self) -> str:
        """Last action of the tool, `open` or `close`; "" if there was none."""
        events = (timed.event for timed in reversed(self.events))
        return next((event.action for event in events if isinstance(event, ToolCommanded)), "")

    def find_interruption(
        self, steps: int, last_command: int = 0, *, is_complete: bool = True
    ) -> Interruption:
        """Return the interruption at the end of the log.

        The steps after a halt and those of an interrupted resumption are not complete, because the arm only
        braked. All steps of a run that ended as INCOMPLETE are complete.

        Args:
            steps: Number of control steps that the world of the cell has made.
            last_command: Control step of the last command to arm or tool by the log of the world.
            is_complete: True if the log holds all events of its last control step.
        """
        incomplete_ends = _find_incomplete_ends(self.events)
        if self.last_tick in incomplete_ends:
            return Interruption(self.last_tick + 1, self.last_action, True, self.last_tick + 1)
        end = self.last_tick + is_complete if self.halt is None else self.halt.tick
        complete = min(steps, end)
        is_cut = steps > self.last_tick and not is_complete
        lacks_actions = self._lacks_command(last_command, is_cut)
        for earlier in reversed(list(self.interruptions.values())):
            if earlier.resumed_at >= complete:
                complete = min(complete, earlier.complete_steps)
                lacks_actions |= earlier.last_action == UNKNOWN_ACTION
        action = UNKNOWN_ACTION if lacks_actions else self.last_action
        return Interruption(complete, action, complete - 1 in incomplete_ends, steps)

    def _lacks_command(self, last_command: int, is_cut: bool) -> bool:
        """Return True if the last command to arm or tool may be missing in the log.

        All commands before the last control step are in the log, because the log is written in order. In the
        last step, an event precedes each command. A kill may leave this step incomplete; if the world got
        beyond the step nevertheless, the log was cut, and `is_cut` is True.
        """
        if last_command != self.last_tick:
            return last_command > self.last_tick
        precedes = (one.tick == last_command for one in self.events if isinstance(one.event, _COMMANDS))
        return is_cut or not any(precedes)

    def is_over(self, tick: int) -> bool:
        """Return True if the recorded run ended before its tree was ticked in this control step."""
        if self.halt is None:
            return tick > self.last_tick
        return self.halt == (tick, False)

    def is_halted_after_tick(self, tick: int) -> bool:
        """Return True if the recorded run was halted after its tree was ticked in this control step."""
        return self.halt == (tick, True)

    def select_before(self, tick: int) -> InputLog:
        """Return the log of all events before a control step, and of the start of the run."""
        return InputLog.from_events(_select_before(self.events, tick))

    def count_events(self, kind: type[Event]) -> int:
        """Return the number of events of a kind."""
        return sum(isinstance(timed.event, kind) for timed in self.events)

    def count_answers(self, name: str) -> int:
        """Return the number of recorded answers of an input."""
        return len(self.inputs.get(name, ()))


def _select_before(events: Iterable[TimedEvent], tick: int) -> list[TimedEvent]:
    return [timed for timed in events if timed.tick < tick or isinstance(timed.event, RunStarted)]


def _find_incomplete_ends(events: Iterable[TimedEvent]) -> set[int]:
    """Return the control steps in which the run ended as INCOMPLETE."""
    ends = ((timed.tick, timed.event) for timed in events if isinstance(timed.event, RunEnded))
    return {tick for tick, end in ends if end.status == "INCOMPLETE"}
