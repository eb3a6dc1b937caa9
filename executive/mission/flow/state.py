"""What is known at a place of the tree, whatever way led there: variables, the tool, failures under way."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import reduce

from executive.mission.model.values import Match
from executive.skill import ToolState

ANYTHING = "*"
"""Source or reason of a failure that nothing is known about."""


@dataclass(frozen=True)
class Grip:
    """What the tool may be, and since when.

    Attributes:
        tool: EMPTY or HOLDING.
        since: Path of the skill that made it so, or "" for the beginning of the run.
        after: The last failure since then that something dealt with, or "".
        moved: Whether the arm may have been moved since then.
    """

    tool: ToolState
    since: str = ""
    after: str = ""
    moved: bool = False


@dataclass(frozen=True)
class State:
    """What is true on every way to a place.

    Attributes:
        written: Variables that surely are written; None where that cannot be known, which counts as all.
        grips: Everything the tool may be; None where that cannot be known.
    """

    written: frozenset[str] | None
    grips: frozenset[Grip] | None

    def join(self, other: State) -> State:
        """Return what is true where two ways meet."""
        if self == other:
            return self
        written = self.written if other.written is None else other.written
        if self.written is not None and other.written is not None:
            written = self.written & other.written
        known = self.grips is not None and other.grips is not None
        return State(written, (self.grips or frozenset()) | (other.grips or frozenset()) if known else None)

    def writing(self, names: Iterable[str]) -> State:
        """Return the state once these variables are written."""
        return self if self.written is None else replace(self, written=self.written.union(names))

    def forgetting(self, name: str) -> State:
        """Return the state once a variable is gone."""
        return self if self.written is None else replace(self, written=self.written - {name})

    def gripping(self, grips: frozenset[Grip] | None) -> State:
        """Return the state with the tool as given."""
        return replace(self, grips=grips)

    def dealt_with(self, failure: Raise) -> State:
        """Return the state where something deals with a failure that led here."""
        grips = [replace(grip, after=str(failure)) for grip in self.grips or ()]
        return self if self.grips is None else self.gripping(frozenset(grips))

    def moved(self) -> State:
        """Return the state once the arm has been moved."""
        moved = [replace(grip, moved=True) for grip in self.grips or ()]
        return self if self.grips is None else self.gripping(frozenset(moved))

    def may_be(self, tool: ToolState) -> Grip | None:
        """Return how the tool may have become so, or None where it cannot be so."""
        found = [grip for grip in self.grips or () if grip.tool is tool]
        return min(found, key=lambda grip: (grip.since, grip.after)) if found else None


BEGINNING = State(frozenset(), frozenset({Grip(ToolState.EMPTY)}))
"""A run begins without variables and with an empty tool."""

UNKNOWN = State(None, None)
"""What follows a part of the tree that nothing is known about."""


@dataclass(frozen=True)
class Raise:
    """A failure that a node may pass on.

    Attributes:
        source: Name of the skill, or the word of the control node, that fails.
        reason: Its reason.
        origin: Path of that node.
        labels: Labels of the nodes it has passed.
    """

    source: str
    reason: str
    origin: str
    labels: frozenset[str] = frozenset()

    def may_match(self, matches: Iterable[Match]) -> bool:
        """Tell whether one of the names may mean this failure."""
        return any(self._is(match, unknown=True) for match in matches)

    def must_match(self, matches: Iterable[Match]) -> bool:
        """Tell whether one of the names surely means this failure."""
        return any(self._is(match, unknown=False) for match in matches)

    def _is(self, match: Match, unknown: bool) -> bool:
        sources = {self.source, *self.labels}
        return (match.reason == self.reason or (unknown and self.reason == ANYTHING)) and (
            match.source in sources or (unknown and self.source == ANYTHING)
        )

    def __str__(self) -> str:
        return f"{self.source}.{self.reason}"


@dataclass(frozen=True)
class Flow:
    """How a node may end when it is entered in a certain state.

    Attributes:
        success: What is true after its success; None where it cannot succeed.
        failures: What is true after each of its failures.
        halted: What is true when it is taken away while it runs; None where it never waits.
    """

    success: State | None
    failures: Mapping[Raise, State]
    halted: State | None

    def labelled(self, label: str) -> Flow:
        """Return the flow of the same node under a label."""
        if not label:
            return self
        failures: dict[Raise, State] = {}
        for failure, state in self.failures.items():
            named = replace(failure, labels=failure.labels | {label})
            failures[named] = state.join(failures.get(named, state))
        return replace(self, failures=failures)


def joined(states: Iterable[State | None]) -> State | None:
    """Return what is true where all these ways meet; None stands for a way that nobody comes."""
    reached = [state for state in states if state is not None]
    return reduce(State.join, reached) if reached else None
