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
"""Source or reason of a failure about which nothing is known."""


@dataclass(frozen=True)
class PossibleTool:
    """A possible state of the tool, and how it came about.

    Attributes:
        tool: EMPTY or HOLDING.
        cause: Path of the skill that caused this state; "" for the beginning of the run.
        handled_failure: Last failure that was handled since then, or "".
        is_arm_moved: True if the arm may have moved since then.
    """

    tool: ToolState
    cause: str = ""
    handled_failure: str = ""
    is_arm_moved: bool = False


PossibleTools = frozenset[PossibleTool] | None
"""All possible states of the tool; None if unknown."""


@dataclass(frozen=True)
class FlowState:
    """Facts that hold on every execution path to a point in the tree.

    Attributes:
        written: Variables that are certainly written; None if unknown, which is treated as all variables.
        tools: All possible states of the tool; None if unknown.
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

    def with_variables(self, names: Iterable[str]) -> FlowState:
        """Return the state after these variables are written."""
        return self if self.written is None else replace(self, written=self.written.union(names))

    def without_variable(self, name: str) -> FlowState:
        """Return the state after a variable is removed."""
        return self if self.written is None else replace(self, written=self.written - {name})

    def with_tools(self, tools: PossibleTools) -> FlowState:
        """Return the state with other possible states of the tool."""
        return replace(self, tools=tools)

    def after_handling(self, failure: PossibleFailure) -> FlowState:
        """Return the state after a control node handled the failure that led to it."""
        tools = [replace(possible, handled_failure=str(failure)) for possible in self.tools or ()]
        return self if self.tools is None else self.with_tools(frozenset(tools))

    def after_motion(self) -> FlowState:
        """Return the state after a motion of the arm."""
        tools = [replace(possible, is_arm_moved=True) for possible in self.tools or ()]
        return self if self.tools is None else self.with_tools(frozenset(tools))

    def find_tool(self, tool: ToolState) -> PossibleTool | None:
        """Return one way in which the tool may have got into this state; None if it cannot be in it."""
        found = [possible for possible in self.tools or () if possible.tool is tool]
        return min(found, key=lambda possible: (possible.cause, possible.handled_failure)) if found else None


INITIAL_STATE = FlowState(frozenset(), frozenset({PossibleTool(ToolState.EMPTY)}))
"""State at the start of a run: no variables, an empty tool."""

UNKNOWN = FlowState(None, None)
"""State after a part of the tree whose effects are unknown."""


@dataclass(frozen=True)
class PossibleFailure:
    """A failure that a node may pass on.

    Attributes:
        source: Name of the skill, or the keyword of the control node, that fails.
        reason: Reason of the failure.
        origin: Path of the node that fails.
        labels: Labels of the nodes that passed the failure on.
    """

    source: str
    reason: str
    origin: str
    labels: frozenset[str] = frozenset()

    def may_match(self, names: Iterable[Reason]) -> bool:
        """Return True if one of the names may denote this failure."""
        return any(self._matches(name, unknown=True) for name in names)

    def must_match(self, names: Iterable[Reason]) -> bool:
        """Return True if one of the names certainly denotes this failure."""
        return any(self._matches(name, unknown=False) for name in names)

    def _matches(self, name: Reason, unknown: bool) -> bool:
        """Return True if a name denotes this failure; with `unknown`, every name matches an unknown part."""
        sources = {self.source, *self.labels}
        return (name.reason == self.reason or (unknown and self.reason == UNKNOWN_NAME)) and (
            name.source in sources or (unknown and self.source == UNKNOWN_NAME)
        )

    def __str__(self) -> str:
        return f"{self.source}.{self.reason}"


@dataclass(frozen=True)
class Flow:
    """Possible ends of a node that is entered in a certain state.

    Attributes:
        success: State after success; None if the node cannot succeed.
        failures: State after each possible failure.
        halted: State after a halt; None if the node always ends in its first tick.
    """

    success: FlowState | None
    failures: Mapping[PossibleFailure, FlowState]
    halted: FlowState | None

    def with_label(self, label: str) -> Flow:
        """Return the flow of the node with a label."""
        if not label:
            return self
        failures: dict[PossibleFailure, FlowState] = {}
        for failure, state in self.failures.items():
            named = replace(failure, labels=failure.labels | {label})
            failures[named] = state.join(failures.get(named, state))
        return replace(self, failures=failures)


Enter: TypeAlias = Callable[[Child, FlowState], Flow]
"""Function that returns how a child may end if it is entered in a state."""


def find_fixed_point(
    enter: Enter, child: Child, state: FlowState, next_entry: Callable[[Flow], FlowState | None]
) -> tuple[Flow, FlowState]:
    """Return how a repeatedly entered child may end, and the state that holds at every entry.

    `next_entry` returns the state of the next entry, given the possible ends of the child; None for no entry.
    """
    entry = state
    while True:
        flow = enter(child, entry)
        # Each round removes variables or adds states of the tool, so the loop ends.
        widened = entry.join(next_entry(flow) or entry)
        if widened == entry:
            return flow, entry
        entry = widened


def join_states(states: Iterable[FlowState | None]) -> FlowState | None:
    """Return the join of all states; None stands for a path that is never taken, also in the result."""
    reached = [state for state in states if state is not None]
    return reduce(FlowState.join, reached) if reached else None


def apply_precondition(tools: PossibleTools, required: ToolState, path: str) -> PossibleTools:
    """Return the states of the tool that a skill requires; if none is possible, the violation is ignored.

    A violated precondition counts as fulfilled, so that one mistake in a mission is reported once.
    """
    if required is ANY or tools is None:
        return tools
    return frozenset(one for one in tools if one.tool is required) or frozenset(
        {PossibleTool(required, path)}
    )


def tools_after_success(tools: PossibleTools, after: ToolState, path: str) -> PossibleTools:
    """Return the possible states of the tool after the success of a skill; ANY leaves them unchanged."""
    if after is ANY or (tools is not None and all(possible.tool is after for possible in tools)):
        return tools
    return frozenset({PossibleTool(after, path)})


def tools_after_failure(tools: PossibleTools, after: ToolState | None, path: str) -> PossibleTools:
    """Return the possible states of the tool after a failure of a skill.

    `after` None leaves them unchanged; `after` ANY adds EMPTY and HOLDING.
    """
    if after is None or tools is None:
        return tools
    if after is ANY:
        return tools | {PossibleTool(EMPTY, path), PossibleTool(HOLDING, path)}
    return frozenset({PossibleTool(after, path)})


def find_tools_at_end(flow: Flow, state: FlowState, halts: bool) -> PossibleTools:
    """Return the possible states of the tool after the end of a branch; `halts` if it may also be halted."""
    ends = join_states((flow.success, *flow.failures.values(), *((flow.halted, state) if halts else ())))
    return state.tools if ends is None else ends.tools


def combine_branches(before: PossibleTools, ends: Iterable[PossibleTools]) -> PossibleTools:
    """Return the possible states of the tool after parallel branches, at most one of which uses it."""
    changed = [end for end in ends if _without_history(end) != _without_history(before)]
    if any(end is None for end in changed):
        return None
    return frozenset(possible for end in changed for possible in end or ()) if changed else before


def _without_history(tools: PossibleTools) -> frozenset[tuple[ToolState, str]] | None:
    """Return the possible states of the tool and their causes, without handled failures and motions."""
    return None if tools is None else frozenset((possible.tool, possible.cause) for possible in tools)
