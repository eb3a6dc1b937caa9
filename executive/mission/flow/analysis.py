"""Abstract execution of the tree over every way it can go, for the checks to ask about.

Every node is entered with the facts that hold on all ways to it (`FlowState`) and returns its ends (`Flow`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from executive.mission.findings import suggest
from executive.mission.model.instance import inspection_instance, node_of
from executive.mission.model.nodes import InnerNode, Node, SkillNode, UseNode
from executive.mission.model.wiring import find_wires
from executive.skill import Direction, Skill
from executive.tree.flow import (
    INITIAL_STATE,
    UNKNOWN,
    UNKNOWN_NAME,
    Flow,
    FlowState,
    PossibleFailure,
    apply_precondition,
    get_tools_after_failure,
    get_tools_after_success,
    join_states,
)
from executive.tree.keys import Child
from executive.tree.node import ControlNode

HALT = "halt"
"""The key of `Skill.tool_left` for the state of the tool after a halt."""


class Analysis:
    """What can happen in a tree.

    Args:
        tree: The tree that runs, with paths.
        skills: Installed skills by name.

    Attributes:
        nodes: Every node by its path.
        entry: Facts that hold where a node begins, by its path; a node that cannot be reached is not there.
        flows: How a node may end, by its path; the failures are those of every entry.
        bodies: Facts that hold after the body of a `use` succeeded, by the path of the use.
        result: How the whole tree may end.
    """

    def __init__(self, tree: Node, skills: Mapping[str, type[Skill]]) -> None:
        self.nodes = {node.path: node for node in tree.walk()}
        self.entry: dict[str, FlowState] = {}
        self.flows: dict[str, Flow] = {}
        self.bodies: dict[str, FlowState | None] = {}
        self._skills = skills
        self._known: dict[tuple[str, FlowState], Flow] = {}
        self._models: dict[str, ControlNode] = {}
        self.result = self._run(tree, INITIAL_STATE)

    def skill(self, name: str) -> type[Skill] | None:
        """Return the skill of this name, or the one that was probably meant."""
        meant = name if name in self._skills else suggest(name, self._skills)
        return self._skills[meant] if meant else None

    def _run(self, node: Node, state: FlowState) -> Flow:
        self.entry[node.path] = state.join(self.entry.get(node.path, state))
        key = node.path, state
        if key not in self._known:
            flow = self._flow(node, state).with_label(node.label)
            self._known[key] = self.flows[node.path] = flow
        return self._known[key]

    def _flow(self, node: Node, state: FlowState) -> Flow:
        match node:
            case InnerNode():
                if node.path not in self._models:
                    self._models[node.path] = inspection_instance(node)
                return self._models[node.path].compute_flow(self._enter, state)
            case SkillNode():
                return self._skill(node, state)
            case UseNode(body=Node() as body):
                return self._use(node, body, state)
        for part in node.children:
            # The states around the parts of an unknown node are not those that the author meant.
            self._run(part, UNKNOWN)
        return Flow(UNKNOWN, {PossibleFailure(UNKNOWN_NAME, UNKNOWN_NAME, node.path): UNKNOWN}, UNKNOWN)

    def _enter(self, child: Child, state: FlowState) -> Flow:
        return self._run(node_of(child), state)

    def _skill(self, node: SkillNode, state: FlowState) -> Flow:
        skill = self.skill(node.skill)
        if skill is None:
            return Flow(UNKNOWN, {PossibleFailure(node.skill, UNKNOWN_NAME, node.path): UNKNOWN}, UNKNOWN)
        before, after = skill.tool_state
        state = state.with_tools(apply_precondition(state.tools, before, node.path))
        outputs = [wire.variable for wire in find_wires(node, skill, Direction.OUT)]
        end = state.after_motion() if skill.moves else state
        success = end.with_variables(outputs).with_tools(get_tools_after_success(end.tools, after, node.path))

        def end_after(reason: str) -> FlowState:
            return end.with_tools(get_tools_after_failure(end.tools, skill.tool_left.get(reason), node.path))

        failures = {
            PossibleFailure(node.skill, reason, node.path): end_after(reason) for reason in skill.reasons
        }
        return Flow(success, failures, end_after(HALT))

    def _use(self, node: UseNode, body: Node, state: FlowState) -> Flow:
        flow = self._run(body, state)
        # One use may be entered in several states: in a finally, in a loop.
        self.bodies[node.path] = join_states((self.bodies.get(node.path), flow.success))
        # A broken promise is one finding there, not one at every reader.
        returned = flow.success and flow.success.with_variables(node.returned)
        return replace(flow, success=returned)
