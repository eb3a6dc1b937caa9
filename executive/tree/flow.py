"""Abstract interpretation of a tree: the states in which a node may be entered, and how it may end."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import reduce
from typing import TypeAlias

from executive.skill import ANY, EMPTY, HOLDING, ToolState
from executive.tree.failure import Reason
from executive.tree.keys import Child

UNKNOWN_NAME = "*"
"""Source or reason of a failure that nothing is known about."""


@dataclass(frozen=True)
class PossibleTool:
    """A possible state of the tool, and how it came about.

    Attributes:
        tool: EMPTY or HOLDING.
        since: Path of the skill that caused this state; "" for the beginning of the run.
        after: Last failure that was handled since then, or "".
        moved: Whether the arm may have been moved since then.
    """

    tool: ToolState
    since: str = ""
    after: str = ""
    moved: bool = False


PossibleTools = frozenset[PossibleTool] | None
"""Everything the tool may be; None where that cannot be known."""


@dataclass(frozen=True)
class FlowState:
    """Facts that hold on every execution path to a point in the tree.

    Attributes:
        written: Variables that are certainly written; None if unknown, which is treated as all variables.
        tools: Everything the tool may be; None where that cannot be known.
    """

    written: frozenset[str] | None
    tools: PossibleTools

    def join(self, other: FlowState) -> FlowState:
        """Return the facts that hold after either of two states."""
        if self == other:
            return self
        written = self.written if other.written is None else other.written
        if self.written is not None and other.written is not None:
            written = self.written & other.written
        known = self.tools is not None and other.tools is not None
        return FlowState(
            written, (self.tools or frozenset()) | (other.tools or frozenset()) if known else None
        )

    def writing(self, names: Iterable[str]) -> FlowState:
        """Return the state once these variables are written."""
        return self if self.written is None else replace(self, written=self.written.union(names))

    def without_variable(self, name: str) -> FlowState:
        """Return the state once a variable is gone."""
        return self if self.written is None else replace(self, written=self.written - {name})

    def with_tools(self, tools: PossibleTools) -> FlowState:
        """Return the state with the tool as given."""
        return replace(self, tools=tools)

    def after_handling(self, failure: PossibleFailure) -> FlowState:
        """Return the state after a control node handled the failure that led to it."""
        tools = [replace(grip, after=str(failure)) for grip in self.tools or ()]
        return self if self.tools is None else self.with_tools(frozenset(tools))

    def moved(self) -> FlowState:
        """Return the state once the arm has been moved."""
        moved = [replace(grip, moved=True) for grip in self.tools or ()]
        return self if self.tools is None else self.with_tools(frozenset(moved))

    def find_tool(self, tool: ToolState) -> PossibleTool | None:
        """Return one way in which the tool may have got into this state; None if it cannot be in it."""
        found = [grip for grip in self.tools or () if grip.tool is tool]
        return min(found, key=lambda grip: (grip.since, grip.after)) if found else None


INITIAL_STATE = FlowState(frozenset(), frozenset({PossibleTool(ToolState.EMPTY)}))
"""A run begins without variables and with an empty tool."""

UNKNOWN = FlowState(None, None)
"""State after a part of the tree whose effects are unknown."""


@dataclass(frozen=True)
class PossibleFailure:
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
        """Return True if one of the names may mean this failure."""
        return any(self._is(match, unknown=True) for match in matches)

    def must_match(self, matches: Iterable[Reason]) -> bool:
        """Return True if one of the names certainly means this failure."""
        return any(self._is(match, unknown=False) for match in matches)

    def _is(self, match: Reason, unknown: bool) -> bool:
        sources = {self.source, *self.labels}
        return (match.reason == self.reason or (unknown and self.reason == UNKNOWN_NAME)) and (
            match.source in sources or (unknown and self.source == UNKNOWN_NAME)
        )

    def __str__(self) -> str:
        return f"{self.source}.{self.reason}"


@dataclass(frozen=True)
class Flow:
    """Possible ends of a node that is entered in a certain state.

    Attributes:
        success: State after its success; None if it cannot succeed.
        failures: State after each possible failure.
        halted: State after it was halted; None if it always ends in its first tick.
    """

    success: FlowState | None
    failures: Mapping[PossibleFailure, FlowState]
    halted: FlowState | None

    def labelled(self, label: str) -> Flow:
        """Return the flow of the same node under a label."""
        if not label:
            return self
        failures: dict[PossibleFailure, FlowState] = {}
        for failure, state in self.failures.items():
            named = replace(failure, labels=failure.labels | {label})
            failures[named] = state.join(failures.get(named, state))
        return replace(self, failures=failures)


Enter: TypeAlias = Callable[[Child, FlowState], Flow]
"""Function that returns how a child may end if it is entered in a state."""


def loop(
    enter: Enter, child: Child, state: FlowState, again: Callable[[Flow], FlowState | None]
) -> tuple[Flow, FlowState]:
    """Return how a repeatedly entered child may end, and the state that holds at every entry.

    `again` returns the state of the next entry, given how the child may end; None if there is no next entry.
    """
    entry = state
    while True:
        flow = enter(child, entry)
        # Variables can only become fewer and tools more, so the loop ends.
        widened = entry.join(again(flow) or entry)
        if widened == entry:
            return flow, entry
        entry = widened


def joined(states: Iterable[FlowState | None]) -> FlowState | None:
    """Return what is true where all these ways meet; None stands for a way that nobody comes."""
    reached = [state for state in states if state is not None]
    return reduce(FlowState.join, reached) if reached else None


def required(tools: PossibleTools, before: ToolState, path: str) -> PossibleTools:
    """Return what the tool may be once a skill has what it needs: one mistake is reported once."""
    if before is ANY or tools is None:
        return tools
    return frozenset(grip for grip in tools if grip.tool is before) or frozenset({PossibleTool(before, path)})


def tools_after_success(tools: PossibleTools, after: ToolState, path: str) -> PossibleTools:
    """Return what the tool is after a skill's success; ANY: as before."""
    if after is ANY or (tools is not None and all(grip.tool is after for grip in tools)):
        return tools
    return frozenset({PossibleTool(after, path)})


def tools_after_failure(tools: PossibleTools, left: ToolState | None, path: str) -> PossibleTools:
    """Return what the tool is after a skill's failure; None: as before, ANY: one or the other."""
    if left is None or tools is None:
        return tools
    if left is ANY:
        return tools | {PossibleTool(EMPTY, path), PossibleTool(HOLDING, path)}
    return frozenset({PossibleTool(left, path)})


def grips_at_end(flow: Flow, state: FlowState, halts: bool) -> PossibleTools:
    """Return what the tool may be once a branch of a parallel is over, halted or not."""
    ends = joined((flow.success, *flow.failures.values(), *((flow.halted, state) if halts else ())))
    return state.tools if ends is None else ends.tools


def combine_branches(before: PossibleTools, ends: Iterable[PossibleTools]) -> PossibleTools:
    """Return the possible states of the tool after parallel branches, at most one of which uses it."""
    changed = [end for end in ends if _holds(end) != _holds(before)]
    if any(end is None for end in changed):
        return None
    return frozenset(grip for end in changed for grip in end or ()) if changed else before


def _holds(tools: PossibleTools) -> frozenset[tuple[ToolState, str]] | None:
    """Return what the tool may hold since when; what was dealt with since then leaves it as it is."""
    return None if tools is None else frozenset((grip.tool, grip.since) for grip in tools)
