"""Abstract interpretation of a tree: entry states and possible outcomes of its nodes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import TypeAlias, TypeVar

from executive.skill import ANY, EMPTY, HALT, HOLDING, Skill, ToolState
from executive.tree.specification import Node, Reason, SkillNode

UNKNOWN_NAME = "*"
"""Placeholder for an unknown source or an unknown reason of a failure."""


@dataclass(frozen=True)
class PossibleToolState:
    """A possible state of the tool at a point in the tree.

    Attributes:
        state: EMPTY or HOLDING.
        cause: Path of the skill that caused the state; "" for the start of the run.
        handled_failure: Last failure that a control node handled in this state of the tool, or "".
    """

    state: ToolState
    cause: str = ""
    handled_failure: str = ""


ToolStates = frozenset[PossibleToolState] | None
"""All possible states of the tool at a point in the tree; None if unknown."""


@dataclass(frozen=True)
class FlowState:
    """State of a run at a point in the tree, as far as the mission determines it.

    Attributes:
        written_variables: Variables that every execution path to the point writes; None if unknown: the
            checker then permits nodes to read every variable.
        tool_states: All possible states of the tool; None if unknown.
    """

    written_variables: frozenset[str] | None
    tool_states: ToolStates

    def join(self, other: FlowState) -> FlowState:
        """Return the state at a point where execution paths from both states meet."""
        if self == other:
            return self
        name_sets = (self.written_variables, other.written_variables)
        known_sets = [names for names in name_sets if names is not None]
        tool_states = None
        if self.tool_states is not None and other.tool_states is not None:
            tool_states = self.tool_states | other.tool_states
        return FlowState(frozenset.intersection(*known_sets) if known_sets else None, tool_states)

    def may_be_unwritten(self, variable: str) -> bool:
        """Return True if an execution path to the point does not write a variable."""
        return self.written_variables is not None and variable not in self.written_variables

    def with_variables(self, names: Iterable[str]) -> FlowState:
        """Return the state after a node has written the variables `names`."""
        variables = self.written_variables
        return self if variables is None else replace(self, written_variables=variables.union(names))

    def without_variable(self, name: str) -> FlowState:
        """Return the state after a node has removed the variable `name`."""
        variables = self.written_variables
        return self if variables is None else replace(self, written_variables=variables - {name})

    def with_tool_states(self, tool_states: ToolStates) -> FlowState:
        """Return the state with `tool_states` as the possible states of the tool."""
        return replace(self, tool_states=tool_states)

    def with_handled_failure(self, failure: PossibleFailure) -> FlowState:
        """Return the state after a control node has handled a failure."""
        if self.tool_states is None:
            return self
        failure_name = f"{failure.source}.{failure.reason}"
        # Merge the states that differ only in `handled_failure`; tuples are hashed faster than dataclasses.
        merged_states = {(state.state, state.cause) for state in self.tool_states}
        states = (PossibleToolState(state, cause, failure_name) for state, cause in merged_states)
        return self.with_tool_states(frozenset(states))

    def apply_precondition(self, required_state: ToolState, path: str) -> FlowState:
        """Return the state at the start of the skill at `path`, which requires a state of the tool.

        If `required_state` is ANY, the state does not change. If the tool cannot be in the required state,
        the result has the required state nevertheless, so that later skills cause no further findings.
        """
        if required_state is ANY or self.tool_states is None:
            return self
        allowed = frozenset(state for state in self.tool_states if state.state is required_state)
        return self.with_tool_states(allowed or frozenset({PossibleToolState(required_state, path)}))

    def apply_success(self, declared_state: ToolState, path: str) -> FlowState:
        """Return the state after success of the skill at `path`; `declared_state` ANY changes nothing."""
        # If the tool is in the declared state already, the state keeps its earlier cause.
        states = {state.state for state in self.tool_states or ()}
        if declared_state is ANY or (self.tool_states is not None and states <= {declared_state}):
            return self
        return self.with_tool_states(frozenset({PossibleToolState(declared_state, path)}))

    def apply_observation(self, observed_state: ToolState, path: str) -> FlowState | None:
        """Return the state after success of the condition at `path`, which can succeed in one state only.

        `observed_state` ANY changes nothing; None if the tool cannot be in the observed state.
        """
        if observed_state is ANY or self.tool_states is None:
            return self.apply_success(observed_state, path)
        remaining = frozenset(state for state in self.tool_states if state.state is observed_state)
        return self.with_tool_states(remaining) if remaining else None

    def apply_failure(self, declared_state: ToolState | None, path: str) -> FlowState:
        """Return the state after a failure or a halt of the skill at `path`.

        `declared_state` None leaves the tool states unchanged; ANY adds EMPTY and HOLDING.
        """
        if declared_state is None or self.tool_states is None:
            return self
        if declared_state is ANY:
            both_states = {PossibleToolState(state, path) for state in (EMPTY, HOLDING)}
            return self.with_tool_states(self.tool_states | both_states)
        return self.with_tool_states(frozenset({PossibleToolState(declared_state, path)}))

    def find_tool_state(self, state: ToolState) -> PossibleToolState | None:
        """Return one of the possible tool states whose `state` is `state`, or None."""
        candidates = (candidate for candidate in self.tool_states or () if candidate.state is state)
        # Sets have no order; `min` makes the findings reproducible.
        return min(candidates, key=lambda state: (state.cause, state.handled_failure), default=None)


INITIAL_STATE = FlowState(frozenset(), frozenset({PossibleToolState(ToolState.EMPTY)}))
"""State at the start of a run: no node has written a variable, and the tool is empty."""

UNKNOWN_STATE = FlowState(None, None)
"""State after a part of the tree whose effects are unknown."""


@dataclass(frozen=True)
class PossibleFailure(Reason):
    """A failure that a node may pass on; `source` is the failing skill or the keyword of a control node.

    Attributes:
        path: Path of the node that fails.
        labels: Labels of the failing node and of the ancestors that passed the failure on.
    """

    path: str
    labels: frozenset[str] = frozenset()

    def may_match(self, reasons: Iterable[Reason]) -> bool:
        """Return True if one of `reasons` may denote the failure; an unknown source or reason matches all."""
        return any(
            self.reason in (reason.reason, UNKNOWN_NAME)
            and (self.source == UNKNOWN_NAME or reason.source in {self.source, *self.labels})
            for reason in reasons
        )

    def matches(self, reasons: Iterable[Reason]) -> bool:
        """Return True if one of `reasons` certainly denotes the failure."""
        sources = {self.source, *self.labels}
        return any(reason.reason == self.reason and reason.source in sources for reason in reasons)

    def with_label(self: FailureT, label: str) -> FailureT:
        """Return the failure with one more label, of a node that passed the failure on; "" adds no label."""
        return replace(self, labels=self.labels | {label}) if label else self


FailureT = TypeVar("FailureT", bound=PossibleFailure)
"""Class of a failure."""


@dataclass(frozen=True)
class Flow:
    """Possible outcomes of a node that starts in one entry state, with the state after each outcome.

    Attributes:
        success: State after success; None if the node cannot succeed.
        failures: State after each possible failure.
        halted: State after a halt; None if the node always ends in its first tick.
    """

    success: FlowState | None
    failures: Mapping[PossibleFailure, FlowState]
    halted: FlowState | None

    @classmethod
    def make_unknown(cls, path: str, source: str = UNKNOWN_NAME) -> Flow:
        """Return the possible outcomes of the node `source` at `path`, whose effects are unknown."""
        failure = PossibleFailure(source, UNKNOWN_NAME, path)
        return cls(UNKNOWN_STATE, {failure: UNKNOWN_STATE}, UNKNOWN_STATE)

    def join_handled(self, reasons: Sequence[Reason] = ()) -> FlowState | None:
        """Return the state after a control node has handled a failure that `reasons` may denote.

        If `reasons` is empty, the node handles all failures. None if it handles none.
        """
        return join_states(
            [
                end.with_handled_failure(failure)
                for failure, end in self.failures.items()
                if not reasons or failure.may_match(reasons)
            ]
        )

    def with_label(self, label: str) -> Flow:
        """Return the flow with the label of the node added to all failures; "" adds no label."""
        if not label:
            return self
        failures: dict[PossibleFailure, FlowState] = {}
        for failure, state in self.failures.items():
            labelled_failure = failure.with_label(label)
            failures[labelled_failure] = state.join(failures.get(labelled_failure, state))
        return replace(self, failures=failures)


def compute_skill_flow(
    node: SkillNode, skill: type[Skill], outputs: Sequence[str], state: FlowState, is_first_tick: bool
) -> Flow:
    """Return the possible outcomes of a skill that starts in a state and writes the variables `outputs`.

    If `is_first_tick` is True, only outcomes in the first tick of the skill are possible.
    """
    precondition, postcondition = skill.tool_state
    state = state.apply_precondition(precondition, node.path)
    success_state = state.with_variables(outputs)
    apply_success = success_state.apply_observation if skill.is_condition else success_state.apply_success
    # A condition grasps no object: a tool that was empty before the condition failed is still empty.
    may_be_holding = state.tool_states is None or state.find_tool_state(HOLDING) is not None
    states_after_failure = skill.tool_state_after_failure if may_be_holding or not skill.is_condition else {}
    ends = {
        reason: state.apply_failure(states_after_failure.get(reason), node.path)
        for reason in (*skill.reasons, HALT)
    }
    failures = {PossibleFailure(node.skill, reason, node.path): ends[reason] for reason in skill.reasons}
    success = apply_success(postcondition, node.path)
    if skill.is_instantaneous():
        return Flow(success, failures, None)
    return Flow(None, {}, ends[HALT]) if is_first_tick else Flow(success, failures, ends[HALT])


FlowFunction: TypeAlias = Callable[[Node, FlowState], Flow]
"""Function that returns the possible outcomes of a child from a state."""


def find_fixed_point(
    get_flow: FlowFunction, child: Node, entry: FlowState, get_next_entry: Callable[[Flow], FlowState | None]
) -> tuple[Flow, FlowState]:
    """Return the possible outcomes of a child that runs repeatedly, and the joined state of all entries.

    `entry` is the state before the first run of the child. `get_next_entry` maps the possible outcomes of
    the child to the state before the next run; None if there is no next run.
    """
    while True:
        flow = get_flow(child, entry)
        # Each iteration removes variables or adds states of the tool, so the loop ends.
        joined_entry = entry.join(get_next_entry(flow) or entry)
        if joined_entry == entry:
            return flow, entry
        entry = joined_entry


def join_states(states: Iterable[FlowState | None]) -> FlowState | None:
    """Return the join of the states that can occur; None stands for a state that cannot occur."""
    possible_states = [state for state in states if state is not None]
    return reduce(FlowState.join, possible_states) if possible_states else None
