"""Recorded inputs and interruptions of a run, read from its journal."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

from executive.events import (
    InputRead,
    RunEnded,
    RunHalted,
    RunResumed,
    RunStarted,
    TimedEvent,
    ToolCommanded,
)


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
    """

    def __init__(self, events: Iterable[TimedEvent]) -> None:
        self.events: list[TimedEvent] = []
        for timed in events:
            if isinstance(timed.event, RunResumed):
                self.events = _select_before(self.events, timed.event.valid_ticks)
            self.events.append(timed)
        incomplete_end_ticks = _find_incomplete_end_ticks(self.events)
        self.inputs: dict[str, list[RecordedInput]] = defaultdict(list)
        self.interruptions: dict[int, Interruption] = {}
        self.halt: Halt | None = None
        for timed in self.events:
            tick, event = timed.tick, timed.event
            match event:
                case RunResumed(count, action):
                    restarts_tree = count - 1 in incomplete_end_ticks
                    self.interruptions[count] = Interruption(count, action, restarts_tree, tick)
                case InputRead(name):
                    self.inputs[name].append(RecordedInput(tick, event))
                case RunHalted(is_tree_ticked):
                    self.halt = Halt(tick, is_tree_ticked)

    @property
    def start_event(self) -> RunStarted | None:
        """First event of the run, or None if the run was interrupted before this event."""
        return next((timed.event for timed in self.events if isinstance(timed.event, RunStarted)), None)

    @property
    def control_period(self) -> float:
        """Duration of a control step [s]."""
        assert self.start_event is not None, "the journal of a replayed run contains its start"
        return self.start_event.step

    @cached_property
    def last_tick(self) -> int:
        """Number of the last control step with an event."""
        return max((timed.tick for timed in self.events), default=0)

    @property
    def last_action(self) -> str:
        """Last action of the tool, `open` or `close`; "" without an action."""
        events = (timed.event for timed in reversed(self.events))
        return next((event.action for event in events if isinstance(event, ToolCommanded)), "")

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
        incomplete_end_ticks = _find_incomplete_end_ticks(self.events)
        if self.last_tick in incomplete_end_ticks:
            return Interruption(self.last_tick + 1, self.last_action, True, self.last_tick + 1)
        logged_count = self.last_tick + 1 if is_complete else self.last_tick
        kept_count = min(step_count, logged_count if self.halt is None else self.halt.tick)
        for interruption in reversed(self.interruptions.values()):
            if interruption.resume_tick >= kept_count:
                kept_count = min(kept_count, interruption.kept_step_count)
        return Interruption(kept_count, self.last_action, kept_count - 1 in incomplete_end_ticks, step_count)

    def has_ended_before_tick(self, tick: int) -> bool:
        """Return True if the recorded run ended before its tree was ticked in control step `tick`."""
        return tick > self.last_tick if self.halt is None else self.halt == (tick, False)

    def select_before(self, tick: int) -> InputLog:
        """Return the log of the events before control step `tick`, including the start of the run."""
        return InputLog(_select_before(self.events, tick))


def _select_before(events: Iterable[TimedEvent], tick: int) -> list[TimedEvent]:
    """Return the events before control step `tick`, including the start of the run."""
    return [timed for timed in events if timed.tick < tick or isinstance(timed.event, RunStarted)]


def _find_incomplete_end_ticks(events: Iterable[TimedEvent]) -> set[int]:
    """Return the control steps in which the run ended as INCOMPLETE."""
    ends = ((timed.tick, timed.event) for timed in events if isinstance(timed.event, RunEnded))
    return {tick for tick, end in ends if end.status == "INCOMPLETE"}
