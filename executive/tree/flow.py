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
"""Source or reason of a failure whose source or reason is unknown."""


@dataclass(frozen=True)
class PossibleToolState:
    """A possible state of the tool, and the cause of the state.

    Attributes:
        state: EMPTY or HOLDING.
        cause: Path of the skill that caused the state; "" for the beginning of the run.
        handled_failure: Last failure that a control node handled in this state of the tool, or "".
        has_arm_moved: True if the arm may have moved in this state of the tool.
    """

    state: ToolState
    cause: str = ""
    handled_failure: str = ""
    has_arm_moved: bool = False


ToolStates = frozenset[PossibleToolState] | None
"""All possible states of the tool at a point in the tree; None if unknown."""


@dataclass(frozen=True)
class FlowState:
    """State of a run at a point in the tree, as far as the mission determines it.

    Attributes:
        written_variables: Variables that are written on every execution path to the point; None if unknown,
            so that every variable may be read.
        tool_states: All possible states of the tool; None if unknown.
    """

    written_variables: frozenset[str] | None
    tool_states: ToolStates

    def join(self, other: FlowState) -> FlowState:
        """Return the state at a point that execution paths through both states reach."""
        if self == other:
            return self
        known = [state.written_variables for state in (self, other) if state.written_variables is not None]
        tool_states = None
        if self.tool_states is not None and other.tool_states is not None:
            tool_states = self.tool_states | other.tool_states
        return FlowState(frozenset.intersection(*known) if known else None, tool_states)

    def with_variables(self, names: Iterable[str]) -> FlowState:
        """Return the state after variables with these names are written."""
        written = self.written_variables
        return self if written is None else replace(self, written_variables=written.union(names))

    def without_variable(self, name: str) -> FlowState:
        """Return the state after the variable `name` is removed."""
        written = self.written_variables
        return self if written is None else replace(self, written_variables=written - {name})

    def with_tool_states(self, tool_states: ToolStates) -> FlowState:
        """Return the state with other possible states of the tool."""
        return replace(self, tool_states=tool_states)

    def with_handled_failure(self, failure: PossibleFailure) -> FlowState:
        """Return the state after a control node handled `failure`, which led to this state."""
        tools = [replace(tool, handled_failure=str(failure)) for tool in self.tool_states or ()]
        return self if self.tool_states is None else self.with_tool_states(frozenset(tools))

    def with_arm_moved(self) -> FlowState:
        """Return the state after a motion of the arm."""
        tools = [replace(tool, has_arm_moved=True) for tool in self.tool_states or ()]
        return self if self.tool_states is None else self.with_tool_states(frozenset(tools))

    def apply_precondition(self, required_state: ToolState, path: str) -> FlowState:
        """Return the state with the possible states of the tool that fulfil the precondition of a skill.

        `required_state` ANY is no precondition. A precondition that no state fulfils counts as fulfilled, so
        that later skills cause no further findings.
        """
        if required_state is ANY or self.tool_states is None:
            return self
        fulfilling = frozenset(tool for tool in self.tool_states if tool.state is required_state)
        return self.with_tool_states(fulfilling or frozenset({PossibleToolState(required_state, path)}))

    def apply_success(self, declared_state: ToolState, path: str) -> FlowState:
        """Return the state after success of a skill that declares a state of the tool; ANY: no change."""
        tools = self.tool_states
        if declared_state is ANY or (
            tools is not None and all(tool.state is declared_state for tool in tools)
        ):
            return self
        return self.with_tool_states(frozenset({PossibleToolState(declared_state, path)}))

    def apply_failure(self, declared_state: ToolState | None, path: str) -> FlowState:
        """Return the state after a failure or halt of a skill that declares a state of the tool for this end.

        `declared_state` None leaves the states of the tool unchanged; ANY adds EMPTY and HOLDING.
        """
        if declared_state is None or self.tool_states is None:
            return self
        if declared_state is ANY:
            unknown = {PossibleToolState(state, path) for state in (EMPTY, HOLDING)}
            return self.with_tool_states(self.tool_states | unknown)
        return self.with_tool_states(frozenset({PossibleToolState(declared_state, path)}))

    def find_tool_state(self, state: ToolState) -> PossibleToolState | None:
        """Return a possible state of the tool that is `state` (EMPTY or HOLDING), or None."""
        matching = (tool for tool in self.tool_states or () if tool.state is state)
        return min(matching, key=lambda tool: (tool.cause, tool.handled_failure), default=None)


INITIAL_STATE = FlowState(frozenset(), frozenset({PossibleToolState(ToolState.EMPTY)}))
"""State at the start of a run: no variables are written, and the tool is empty."""

UNKNOWN_STATE = FlowState(None, None)
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

    def may_match(self, reasons: Iterable[Reason]) -> bool:
        """Return True if one of `reasons` may denote this failure, whose source or reason may be unknown."""
        return any(
            self.reason in (reason.reason, UNKNOWN_NAME)
            and (self.source == UNKNOWN_NAME or reason.source in {self.source, *self.labels})
            for reason in reasons
        )

    def must_match(self, reasons: Iterable[Reason]) -> bool:
        """Return True if one of `reasons` certainly denotes this failure."""
        sources = {self.source, *self.labels}
        return any(reason.reason == self.reason and reason.source in sources for reason in reasons)

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
        """Return the flow of a node with a label, whose failures carry the label; "" for no label."""
        if not label:
            return self
        failures: dict[PossibleFailure, FlowState] = {}
        for failure, state in self.failures.items():
            labelled_failure = replace(failure, labels=failure.labels | {label})
            failures[labelled_failure] = state.join(failures.get(labelled_failure, state))
        return replace(self, failures=failures)


def make_unknown_flow(source: str, path: str) -> Flow:
    """Return the possible ends of a node whose effects are unknown; `source` fails at the path `path`."""
    failure = PossibleFailure(source, UNKNOWN_NAME, path)
    return Flow(UNKNOWN_STATE, {failure: UNKNOWN_STATE}, UNKNOWN_STATE)


FlowFunction: TypeAlias = Callable[[Child, FlowState], Flow]
"""Function that returns the possible ends of a child that is entered in a state."""


def find_fixed_point(
    get_flow: FlowFunction, child: Child, state: FlowState, get_next_entry: Callable[[Flow], FlowState | None]
) -> tuple[Flow, FlowState]:
    """Return the possible ends of a child that is entered repeatedly, and the joined state of all entries.

    `state` is the state at the first entry. `get_next_entry` returns the state at the next entry, given the
    possible ends of the child; None if the child is not entered again.
    """
    entry = state
    while True:
        flow = get_flow(child, entry)
        # Each iteration removes variables or adds states of the tool, so the loop ends.
        joined_entry = entry.join(get_next_entry(flow) or entry)
        if joined_entry == entry:
            return flow, entry
        entry = joined_entry


def join_states(states: Iterable[FlowState | None]) -> FlowState | None:
    """Join the states that can occur; None stands for a state that cannot occur."""
    possible_states = [state for state in states if state is not None]
    return reduce(FlowState.join, possible_states) if possible_states else None


def find_end_tool_states(flow: Flow, entry: FlowState, can_be_halted: bool) -> ToolStates:
    """Return the possible states of the tool at the end of a branch that was entered in the state `entry`."""
    halt_states = (flow.halted, entry) if can_be_halted else ()
    return (join_states((flow.success, *flow.failures.values(), *halt_states)) or entry).tool_states


def combine_tool_states(entry: ToolStates, branch_ends: Iterable[ToolStates]) -> ToolStates:
    """Return the possible states of the tool after parallel branches, at most one of which uses the tool.

    `entry` are the states before the branches, `branch_ends` the states at the end of each branch.
    """
    changed = [states for states in branch_ends if _remove_history(states) != _remove_history(entry)]
    if any(states is None for states in changed):
        return None
    return frozenset(tool for states in changed for tool in states or ()) if changed else entry


def _remove_history(tool_states: ToolStates) -> frozenset[tuple[ToolState, str]] | None:
    """Return the possible states of the tool and their causes, without handled failures and motions."""
    return None if tool_states is None else frozenset((tool.state, tool.cause) for tool in tool_states)
