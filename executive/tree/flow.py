"""Abstract execution of a tree: the facts that hold on every way to a node, and how a node may end."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import reduce
from typing import TypeAlias

from executive.skill import ANY, EMPTY, HOLDING, ToolState
from executive.tree.failure import Reason
from executive.tree.keys import Child

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


Grips = frozenset[Grip] | None
"""Everything the tool may be; None where that cannot be known."""


@dataclass(frozen=True)
class State:
    """What is true on every way to a place.

    Attributes:
        written: Variables that surely are written; None where that cannot be known, which counts as all.
        grips: Everything the tool may be; None where that cannot be known.
    """

    written: frozenset[str] | None
    grips: Grips

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

    def gripping(self, grips: Grips) -> State:
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

    def may_match(self, matches: Iterable[Reason]) -> bool:
        """Tell whether one of the names may mean this failure."""
        return any(self._is(match, unknown=True) for match in matches)

    def must_match(self, matches: Iterable[Reason]) -> bool:
        """Tell whether one of the names surely means this failure."""
        return any(self._is(match, unknown=False) for match in matches)

    def _is(self, match: Reason, unknown: bool) -> bool:
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


Enter: TypeAlias = Callable[[Child, State], Flow]
"""Function that returns how a child may end if it is entered in a state."""


def loop(
    enter: Enter, child: Child, state: State, again: Callable[[Flow], State | None]
) -> tuple[Flow, State]:
    """Return how a child may end that is entered repeatedly, and the facts that hold at every entry.

    `again` returns the state of the next entry, given how the child may end; None if there is no next entry.
    """
    entry = state
    while True:
        flow = enter(child, entry)
        # Variables can only become fewer and grips more, so the loop ends.
        widened = entry.join(again(flow) or entry)
        if widened == entry:
            return flow, entry
        entry = widened


def joined(states: Iterable[State | None]) -> State | None:
    """Return what is true where all these ways meet; None stands for a way that nobody comes."""
    reached = [state for state in states if state is not None]
    return reduce(State.join, reached) if reached else None


def required(grips: Grips, before: ToolState, path: str) -> Grips:
    """Return what the tool may be once a skill has what it needs: one mistake is told once."""
    if before is ANY or grips is None:
        return grips
    return frozenset(grip for grip in grips if grip.tool is before) or frozenset({Grip(before, path)})


def left_after(grips: Grips, after: ToolState, path: str) -> Grips:
    """Return what the tool is after a skill's success; ANY: as before."""
    if after is ANY or (grips is not None and all(grip.tool is after for grip in grips)):
        return grips
    return frozenset({Grip(after, path)})


def left_after_failure(grips: Grips, left: ToolState | None, path: str) -> Grips:
    """Return what the tool is after a skill's failure; None: as before, ANY: one or the other."""
    if left is None or grips is None:
        return grips
    if left is ANY:
        return grips | {Grip(EMPTY, path), Grip(HOLDING, path)}
    return frozenset({Grip(left, path)})


def grips_at_end(flow: Flow, state: State, halts: bool) -> Grips:
    """Return what the tool may be once a branch of a parallel is over, halted or not."""
    ends = joined((flow.success, *flow.failures.values(), *((flow.halted, state) if halts else ())))
    return state.grips if ends is None else ends.grips


def together(before: Grips, ends: Iterable[Grips]) -> Grips:
    """Return what the tool may be after branches of which one at most has used it."""
    changed = [end for end in ends if _holds(end) != _holds(before)]
    if any(end is None for end in changed):
        return None
    return frozenset(grip for end in changed for grip in end or ()) if changed else before


def _holds(grips: Grips) -> frozenset[tuple[ToolState, str]] | None:
    """Return what the tool may hold since when; what was dealt with since then leaves it as it is."""
    return None if grips is None else frozenset((grip.tool, grip.since) for grip in grips)
