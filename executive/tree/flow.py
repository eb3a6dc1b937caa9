"""Abstract interpretation of a tree: possible states at the start of a node, and its possible ends."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import reduce
from typing import TypeAlias

from executive.skill import ANY, EMPTY, HOLDING, ToolState
from executive.tree.failure import Reason
from executive.tree.keys import Child

UNKNOWN_NAME = "*"
"""Source or reason of a failure of unknown origin."""


@dataclass(frozen=True)
class PossibleToolState:
    """A possible state of the tool, and its history.

    Attributes:
        tool: EMPTY or HOLDING.
        cause: Path of the skill that caused this state; "" for the beginning of the run.
        handled_failure: Last failure that a control node handled in this state of the tool, or "".
        is_arm_moved: True if the arm may have moved in this state of the tool.
    """

    tool: ToolState
    cause: str = ""
    handled_failure: str = ""
    is_arm_moved: bool = False


ToolStates = frozenset[PossibleToolState] | None
"""All possible states of the tool at a point in the tree; None if unknown."""


@dataclass(frozen=True)
class FlowState:
    """Facts that hold on every execution path to a point in the tree.

    Attributes:
        written: Variables that are certainly written; None if unknown, so that every variable may be read.
        tools: All possible states of the tool; None if unknown.
    """

    written: frozenset[str] | None
    tools: ToolStates

    def join(self, other: FlowState) -> FlowState:
        """Return the facts that hold in both states: the common variables, and all possible tool states."""
        if self == other:
            return self
        written = self.written if other.written is None else other.written
        if self.written is not None and other.written is not None:
            written = self.written & other.written
        are_tools_known = self.tools is not None and other.tools is not None
        tools = (self.tools or frozenset()) | (other.tools or frozenset()) if are_tools_known else None
        return FlowState(written, tools)

    def with_variables(self, names: Iterable[str]) -> FlowState:
        """Return the state after these variables are written."""
        return self if self.written is None else replace(self, written=self.written.union(names))

    def without_variable(self, name: str) -> FlowState:
        """Return the state after a variable is removed."""
        return self if self.written is None else replace(self, written=self.written - {name})

    def with_tools(self, tools: ToolStates) -> FlowState:
        """Return the state with other possible states of the tool."""
        return replace(self, tools=tools)

    def after_handling(self, failure: PossibleFailure) -> FlowState:
        """Return the state after a control node handled `failure`, which led to this state."""
        tools = [replace(possible, handled_failure=str(failure)) for possible in self.tools or ()]
        return self if self.tools is None else self.with_tools(frozenset(tools))

    def after_motion(self) -> FlowState:
        """Return the state after a motion of the arm."""
        tools = [replace(possible, is_arm_moved=True) for possible in self.tools or ()]
        return self if self.tools is None else self.with_tools(frozenset(tools))

    def find_tool_state(self, tool: ToolState) -> PossibleToolState | None:
        """Return a possible state in which the tool is EMPTY or HOLDING as given; None if there is none."""
        found = [possible for possible in self.tools or () if possible.tool is tool]
        return min(found, key=lambda possible: (possible.cause, possible.handled_failure)) if found else None


INITIAL_STATE = FlowState(frozenset(), frozenset({PossibleToolState(ToolState.EMPTY)}))
"""State at the start of a run: no variables are written, and the tool is empty."""

UNKNOWN = FlowState(None, None)
"""State after a part of the tree whose effects are unknown."""


@dataclass(frozen=True)
class PossibleFailure:
    """A failure that a node may pass on.

    Attributes:
        source: Name of the skill, or the keyword of the control node, that fails.
        reason: Declared cause of the failure.
        origin: Path of the node that fails.
        labels: Labels of the failing node and of the ancestors that passed the failure on.
    """

    source: str
    reason: str
    origin: str
    labels: frozenset[str] = frozenset()

    def may_match(self, names: Iterable[Reason]) -> bool:
        """Return True if one of the names may denote this failure."""
        return any(self._matches(name, unknown_matches=True) for name in names)

    def must_match(self, names: Iterable[Reason]) -> bool:
        """Return True if one of the names certainly denotes this failure."""
        return any(self._matches(name, unknown_matches=False) for name in names)

    def _matches(self, name: Reason, unknown_matches: bool) -> bool:
        """Return True if a name denotes this failure.

        With `unknown_matches`, an unknown source or reason of this failure matches every name.
        """
        sources = {self.source, *self.labels}
        return (name.reason == self.reason or (unknown_matches and self.reason == UNKNOWN_NAME)) and (
            name.source in sources or (unknown_matches and self.source == UNKNOWN_NAME)
        )

    def __str__(self) -> str:
        return f"{self.source}.{self.reason}"


@dataclass(frozen=True)
class Flow:
    """Result of the abstract execution of a node from one state: its possible ends.

    Attributes:
        success: State after success; None if the node cannot succeed.
        failures: State after each possible failure.
        halted: State after a halt; None if the node always ends in its first tick.
    """

    success: FlowState | None
    failures: Mapping[PossibleFailure, FlowState]
    halted: FlowState | None

    def with_label(self, label: str) -> Flow:
        """Return the same possible ends of a node with a label; "" for no label."""
        if not label:
            return self
        failures: dict[PossibleFailure, FlowState] = {}
        for failure, state in self.failures.items():
            named = replace(failure, labels=failure.labels | {label})
            failures[named] = state.join(failures.get(named, state))
        return replace(self, failures=failures)


FlowFunction: TypeAlias = Callable[[Child, FlowState], Flow]
"""Function that returns the possible ends of a child that is entered in a state."""


def find_fixed_point(
    flow_of: FlowFunction, child: Child, state: FlowState, get_next_entry: Callable[[Flow], FlowState | None]
) -> tuple[Flow, FlowState]:
    """Return the possible ends of a child that is entered repeatedly, and the facts that hold at every entry.

    `get_next_entry` returns the state at the next entry, given the possible ends of the child; None if the
    child is not entered again.
    """
    entry = state
    while True:
        flow = flow_of(child, entry)
        # Each iteration removes variables or adds states of the tool, so the loop ends.
        widened = entry.join(get_next_entry(flow) or entry)
        if widened == entry:
            return flow, entry
        entry = widened


def join_states(states: Iterable[FlowState | None]) -> FlowState | None:
    """Return the facts that hold in all states; a state None cannot occur and is ignored; None if all are."""
    reached = [state for state in states if state is not None]
    return reduce(FlowState.join, reached) if reached else None


def apply_precondition(tools: ToolStates, required: ToolState, path: str) -> ToolStates:
    """Return the possible states of the tool that fulfil the precondition of a skill.

    A precondition that no state fulfils counts as fulfilled, so that one mistake is reported only once.

    Args:
        tools: Possible states of the tool before the skill.
        required: State that the skill requires; ANY for no precondition.
        path: Path of the skill.
    """
    if required is ANY or tools is None:
        return tools
    fulfilling = frozenset(possible for possible in tools if possible.tool is required)
    return fulfilling or frozenset({PossibleToolState(required, path)})


def get_tools_after_success(tools: ToolStates, after: ToolState, path: str) -> ToolStates:
    """Return the possible states of the tool after success; `after` is the declared state, ANY: no change."""
    if after is ANY or (tools is not None and all(possible.tool is after for possible in tools)):
        return tools
    return frozenset({PossibleToolState(after, path)})


def get_tools_after_failure(tools: ToolStates, after: ToolState | None, path: str) -> ToolStates:
    """Return the possible states of the tool after a failure of a skill.

    `after` is the declared state; None leaves the states unchanged, ANY adds EMPTY and HOLDING.
    """
    if after is None or tools is None:
        return tools
    if after is ANY:
        return tools | {PossibleToolState(EMPTY, path), PossibleToolState(HOLDING, path)}
    return frozenset({PossibleToolState(after, path)})


def find_tools_at_end(flow: Flow, entry: FlowState, may_be_halted: bool) -> ToolStates:
    """Return the possible states of the tool at the end of a branch that was entered in the state `entry`."""
    halts = (flow.halted, entry) if may_be_halted else ()
    end = join_states((flow.success, *flow.failures.values(), *halts))
    return entry.tools if end is None else end.tools


def combine_tools(before: ToolStates, ends: Iterable[ToolStates]) -> ToolStates:
    """Return the possible states of the tool after parallel branches, at most one of which uses the tool.

    `before` are the states before the branches, `ends` the states at the end of each branch.
    """
    changed = [end for end in ends if _remove_history(end) != _remove_history(before)]
    if any(end is None for end in changed):
        return None
    return frozenset(possible for end in changed for possible in end or ()) if changed else before


def _remove_history(tools: ToolStates) -> frozenset[tuple[ToolState, str]] | None:
    """Return the possible states of the tool and their causes, without handled failures and motions."""
    return None if tools is None else frozenset((possible.tool, possible.cause) for possible in tools)
