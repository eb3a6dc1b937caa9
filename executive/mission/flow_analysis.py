"""Data-flow analysis of the tree over all execution paths, and the failures that no node handles."""

from __future__ import annotations

from dataclasses import dataclass, replace

from executive.mission.findings import find_similar_word
from executive.mission.model.instance import get_mission_node, make_inspection_instance
from executive.mission.model.nodes import InnerNode, Node, SkillNode, SubtreeNode
from executive.mission.model.wiring import find_wires
from executive.plugins import Skills
from executive.skill import HALT, HOLDING, Direction, Skill
from executive.tree.flow import INITIAL_STATE, UNKNOWN_STATE, Flow, FlowState, PossibleFailure, join_states
from executive.tree.keys import Child
from executive.tree.node import ControlNode


class FlowAnalysis:
    """Possible entry states and ends (success, failures, halt) of every node of a tree.

    Args:
        tree: Expanded tree with paths.
        skills: Installed skills by name.
        entry: State in which the tree starts.
        is_first_tick: True to analyse only the first tick, so that a skill that takes time does not end.

    Attributes:
        nodes: Every node by its path.
        entry_states: Join of the states in which a node may start, by path; without unreachable nodes.
        flows: Possible ends of each node, for the entry state that was analysed last, by path.
        body_end_states: Join of the states after success of the body of a `use`, by path of the `use`.
        root_flow: Possible ends of the whole tree.
    """

    def __init__(
        self, tree: Node, skills: Skills, entry: FlowState = INITIAL_STATE, *, is_first_tick: bool = False
    ) -> None:
        self.nodes = {node.path: node for node in tree.walk()}
        self.entry_states: dict[str, FlowState] = {}
        self.flows: dict[str, Flow] = {}
        self.body_end_states: dict[str, FlowState | None] = {}
        self._skills, self._is_first_tick = skills, is_first_tick
        self._flows_by_entry: dict[tuple[str, FlowState], Flow] = {}
        self._instances: dict[str, ControlNode] = {}
        self.root_flow = self._analyse(tree, entry)

    def find_skill_or_most_similar(self, name: str) -> type[Skill] | None:
        """Return the skill `name`; if it is misspelled, the most similar skill; None if there is none."""
        known_name = name if name in self._skills else find_similar_word(name, self._skills)
        return self._skills[known_name] if known_name else None

    def _analyse(self, node: Node, state: FlowState) -> Flow:
        """Return the possible ends of a node that starts in a state, from the cache if possible."""
        self.entry_states[node.path] = state.join(self.entry_states.get(node.path, state))
        entry = node.path, state
        if entry not in self._flows_by_entry:
            flow = self._compute_flow(node, state).with_label(node.label)
            self._flows_by_entry[entry] = self.flows[node.path] = flow
        return self._flows_by_entry[entry]

    def _compute_flow(self, node: Node, state: FlowState) -> Flow:
        match node:
            case InnerNode():
                if node.path not in self._instances:
                    self._instances[node.path] = make_inspection_instance(node)
                return self._instances[node.path].compute_flow(self._analyse_child, state)
            case SkillNode():
                return self._compute_skill_flow(node, state)
            case SubtreeNode(body=Node() as body):
                return self._compute_subtree_flow(node, body, state)
        for child in node.children:
            self._analyse(child, UNKNOWN_STATE)
        return Flow.make_unknown(node.path)

    def _analyse_child(self, child: Child, state: FlowState) -> Flow:
        return self._analyse(get_mission_node(child), state)

    def _compute_skill_flow(self, node: SkillNode, state: FlowState) -> Flow:
        skill = self.find_skill_or_most_similar(node.skill)
        if skill is None:
            return Flow.make_unknown(node.path, node.skill)
        precondition, postcondition = skill.tool_state
        state = state.apply_precondition(precondition, node.path)
        outputs = [wire.variable for wire in find_wires(node, skill, Direction.OUT)]
        success_state = state.with_variables(outputs)
        apply_success = success_state.apply_observation if skill.is_condition else success_state.apply_success
        # A condition grasps no object: a tool that was empty before the condition failed is still empty.
        may_be_holding = state.tool_states is None or state.find_tool_state(HOLDING) is not None
        tool_states_after_failure = (
            skill.tool_state_after_failure if may_be_holding or not skill.is_condition else {}
        )
        end_states = {
            key: state.apply_failure(tool_states_after_failure.get(key), node.path)
            for key in (*skill.reasons, HALT)
        }
        failures = {PossibleFailure(node.skill, key, node.path): end_states[key] for key in skill.reasons}
        success = apply_success(postcondition, node.path)
        if skill.is_instantaneous():
            return Flow(success, failures, None)
        halted = end_states[HALT]
        return Flow(None, {}, halted) if self._is_first_tick else Flow(success, failures, halted)

    def _compute_subtree_flow(self, node: SubtreeNode, body: Node, state: FlowState) -> Flow:
        flow = self._analyse(body, state)
        # In a loop, one use may start in several states.
        self.body_end_states[node.path] = join_states((self.body_end_states.get(node.path), flow.success))
        # `find_unwritten_returns` reports unwritten returned variables, so they count as written here.
        return replace(flow, success=flow.success and flow.success.with_variables(node.written_variables))


@dataclass(frozen=True)
class UnhandledFailure:
    """A failure that can end the mission, because no node handles it.

    Attributes:
        source: Name of the skill, or keyword of the control node, that fails.
        reason: Reason of the failure.
        node: Path of the node that fails, in the tree.
        path: Path of the file that contains the node.
        line: Line of the node in the file.
    """

    source: str
    reason: str
    node: str
    path: str
    line: int


def find_unhandled_failures(analysis: FlowAnalysis) -> tuple[UnhandledFailure, ...]:
    """Return the failures that can end the mission, in the order of the tree."""
    order = {path: index for index, path in enumerate(analysis.nodes)}
    failures = sorted(analysis.root_flow.failures, key=lambda end: (order[end.origin], end.reason))
    spans = [analysis.nodes[failure.origin].span for failure in failures]
    return tuple(
        UnhandledFailure(failure.source, failure.reason, failure.origin, span.source.path, span.line)
        for failure, span in zip(failures, spans, strict=True)
    )
