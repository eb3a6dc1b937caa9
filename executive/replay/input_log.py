"""Recorded inputs of a run and its interruptions, from its journal."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

Entry = Mapping[str, Any]
"""Line of a journal: `tick`, `clock`, `kind` and the keys of the kind."""


@dataclass(frozen=True)
class RecordedInput:
    """One answer of a cell.

    Attributes:
        tick: Control step in which the answer was read.
        nth: Number of times that the same input had been read in this step, this time included.
        value: The answer as plain values, or the text of the exception.
        raised: Name of the exception that the cell raised; "" for an answer.
    """

    tick: int
    nth: int
    value: Any
    raised: str = ""


@dataclass(frozen=True)
class Interruption:
    """Time between the end of a process that executed a run, and the resumption of the run.

    Attributes:
        complete: Number of control steps before the interruption that count.
        last_action: Last action of the tool before the interruption, `open` or `close`; "" if there was none.
        reopens: True if the run had ended as INCOMPLETE, so that the tree starts again.
        resumed: Control step at which the run was resumed.
    """

    complete: int
    last_action: str
    reopens: bool
    resumed: int


@dataclass(frozen=True)
class InputLog:
    """Inputs and interruptions of a run so far.

    Attributes:
        entries: Entries of the journal that count, in order.
        inputs: Recorded answers by name of the input, in order; repeated answers are left out.
        interruptions: Interruptions by `Interruption.complete`.
        halt: Entry of the last halt, or None.
    """

    entries: Sequence[Entry]
    inputs: Mapping[str, Sequence[RecordedInput]] = field(default_factory=dict)
    interruptions: Mapping[int, Interruption] = field(default_factory=dict)
    halt: Entry | None = None

    @staticmethod
    def of(entries: Iterable[Entry]) -> InputLog:
        """Return the log of a journal.

        A resumption makes everything void that happened in the incomplete control step before it, and later.
        """
        kept: list[Entry] = []
        for entry in entries:
            if entry["kind"] == "resume":
                kept = [one for one in kept if one["tick"] < entry["ticked"] or one["kind"] == "run"]
            kept.append(entry)
        reopened = {end + 1 for end in _incomplete_ends(kept)}
        interruptions = {
            e["ticked"]: Interruption(e["ticked"], e["intent"], e["ticked"] in reopened, e["tick"])
            for e in kept
            if e["kind"] == "resume"
        }
        inputs: dict[str, list[RecordedInput]] = defaultdict(list)
        for entry in kept:
            if entry["kind"] == "sense":
                inputs[entry["name"]].append(
                    RecordedInput(entry["tick"], entry["nth"], entry["value"], entry.get("raised", ""))
                )
        halt = next((entry for entry in reversed(kept) if entry["kind"] == "halt"), None)
        return InputLog(kept, inputs, interruptions, halt)

    @property
    def start(self) -> Entry | None:
        """Entry of the start of the run, or None if the run had not started."""
        return next((entry for entry in self.entries if entry["kind"] == "run"), None)

    @property
    def step(self) -> float:
        """Length of a control step [s]."""
        assert self.start is not None, "a run that is replayed has started"
        return float(self.start["step"])

    @property
    def last_tick(self) -> int:
        """Last control step with an entry."""
        return max((entry["tick"] for entry in self.entries), default=0)

    @property
    def last_action(self) -> str:
        """Last action of the tool, `open` or `close`; "" if there was none."""
        return next((e["action"] for e in reversed(self.entries) if e["kind"] == "intent"), "")

    def interruption_after(self, steps: int) -> Interruption:
        """Return the interruption at the end of the log.

        The last control step with an entry may be incomplete. The steps in which the arm only braked do not
        count: those from a halt on, and those of an interrupted resumption. A run that ended as INCOMPLETE
        counts as a whole.

        Args:
            steps: Number of control steps that the world of the cell has made.
        """
        if self.last_tick in _incomplete_ends(self.entries):
            return Interruption(self.last_tick + 1, self.last_action, True, self.last_tick + 1)
        complete = min(steps, self.last_tick + 1 if self.halt is None else int(self.halt["tick"]))
        for earlier in reversed(list(self.interruptions.values())):
            if earlier.resumed >= complete:
                complete = min(complete, earlier.complete)
        return Interruption(complete, self.last_action, complete - 1 in _incomplete_ends(self.entries), steps)

    def is_over(self, tick: int) -> bool:
        """Return True if the recorded run ended before its tree was ticked in this control step."""
        if self.halt is None:
            return tick > self.last_tick
        return bool(self.halt["tick"] == tick and not self.halt["ticked"])

    def is_halted_after_tick(self, tick: int) -> bool:
        """Return True if the recorded run was halted after its tree was ticked in this control step."""
        return self.halt is not None and bool(self.halt["tick"] == tick and self.halt["ticked"])

    def before(self, tick: int) -> InputLog:
        """Return the log of everything before a control step, and of the start of the run."""
        return InputLog.of(e for e in self.entries if e["tick"] < tick or e["kind"] == "run")

    def number_of(self, kind: str) -> int:
        """Return the number of entries of a kind."""
        return sum(entry["kind"] == kind for entry in self.entries)

    def number_of_answers(self, name: str) -> int:
        """Return the number of recorded answers of an input."""
        return len(self.inputs.get(name, ()))


def _incomplete_ends(entries: Iterable[Entry]) -> frozenset[int]:
    """Return the control steps in which the run ended as INCOMPLETE."""
    return frozenset(e["tick"] for e in entries if e["kind"] == "end" and e.get("status") == "INCOMPLETE")
