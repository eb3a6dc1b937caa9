"""What a journal says of a run so far, as a tape can play it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

Entry = Mapping[str, Any]
"""A line of a journal: `tick`, `clock`, `kind` and what belongs to the kind."""


@dataclass(frozen=True)
class Sense:
    """One answer of a cell.

    Attributes:
        tick: Control step in which it was asked for.
        nth: How many times the same had been asked in that step, this time included.
        value: The answer, as plain values.
        raised: Name of the exception that was the answer, its text being the value; "" where it was none.
    """

    tick: int
    nth: int
    value: Any
    raised: str = ""


@dataclass(frozen=True)
class Past:
    """A run so far.

    Attributes:
        entries: What counts of its journal, in order: without what a kill made void.
        senses: What the cell answered, by what it was asked; only answers unlike the one before.
        resumes: Where it was taken up again: after how many control steps that count, and the entry for it.
        halt: The entry for how it was halted, or None.
    """

    entries: Sequence[Entry]
    senses: Mapping[str, Sequence[Sense]] = field(default_factory=dict)
    resumes: Mapping[int, Entry] = field(default_factory=dict)
    halt: Entry | None = None

    @staticmethod
    def of(entries: Iterable[Entry]) -> Past:
        """Return the past that a journal tells of.

        Where a run was taken up again, what had happened in the control step that was not ended by then,
        and later, is void.
        """
        kept: list[Entry] = []
        for entry in entries:
            if entry["kind"] == "resume":
                kept = [one for one in kept if one["tick"] < entry["ticked"] or one["kind"] == "run"]
            kept.append(entry)
        senses: dict[str, list[Sense]] = defaultdict(list)
        for entry in kept:
            if entry["kind"] == "sense":
                senses[entry["name"]].append(
                    Sense(entry["tick"], entry["nth"], entry["value"], entry.get("raised", ""))
                )
        return Past(
            kept,
            senses,
            {entry["ticked"]: entry for entry in kept if entry["kind"] == "resume"},
            next((entry for entry in reversed(kept) if entry["kind"] == "halt"), None),
        )

    @property
    def start(self) -> Entry | None:
        """The entry for how it began; None where it had not."""
        return next((entry for entry in self.entries if entry["kind"] == "run"), None)

    @property
    def incomplete(self) -> Sequence[int]:
        """Control steps after which it had ended as INCOMPLETE: the tree begins again when it is resumed."""
        return [e["tick"] for e in self.entries if e["kind"] == "end" and e.get("status") == "INCOMPLETE"]

    @property
    def step(self) -> float:
        """Length of a control step [s]."""
        assert self.start is not None, "a run that is played has begun"
        return float(self.start["step"])

    @property
    def last_tick(self) -> int:
        """The last control step that it tells of."""
        return max((entry["tick"] for entry in self.entries), default=0)

    @property
    def last_intent(self) -> str:
        """What the tool was told last, `open` or `close`; "" where it was told nothing."""
        return next((e["action"] for e in reversed(self.entries) if e["kind"] == "intent"), "")

    def complete(self, steps: int) -> int:
        """Return how many control steps count, of `steps` that the cell's world has made.

        What came after the last step that it tells of decided nothing. The step in which the run was halted
        does not count, nor do those after it: the arm was only braked then. A run that ended as INCOMPLETE
        counts as a whole.
        """
        if self.last_tick in self.incomplete:
            return self.last_tick + 1
        return min(steps, self.last_tick + 1 if self.halt is None else int(self.halt["tick"]))

    def is_reopened(self, tick: int, live_from: int | None) -> bool:
        """Tell whether the run, once its tree ends in this control step, ends as INCOMPLETE and is resumed.

        `live_from` is the control step at which it is resumed now; None: it is only played.
        """
        ended = next((end for end in self.incomplete if end >= tick), None)
        return ended is not None and (ended + 1 == live_from or ended + 1 in self.resumes)

    def is_halted(self, tick: int, *, before: bool) -> bool:
        """Return True if the run was halted in this control step, before or after its tree was ticked."""
        if self.halt is None:
            return tick > self.last_tick
        return bool(self.halt["tick"] == tick and self.halt["ticked"] is not before)

    def before(self, tick: int) -> Past:
        """Return what had happened before a control step; how it began always had."""
        return Past.of(e for e in self.entries if e["tick"] < tick or e["kind"] == "run")

    def number_of(self, kind: str) -> int:
        """Return how many events of a kind it tells of."""
        return sum(entry["kind"] == kind for entry in self.entries)

    def number_of_answers(self, name: str) -> int:
        """Return how often the cell gave a new answer to what is called `name`."""
        return len(self.senses.get(name, ()))
