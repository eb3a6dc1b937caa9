"""Input of the checks: data-flow analysis of the tree, mission, installed skills, and cell."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from executive.behaviours import Skills
from executive.cell.config import CellConfig
from executive.mission.mission_file import Mission
from executive.mission.ports import Wire, find_node_wires, find_wires, find_written_variables
from executive.skill import Direction, Param, Skill
from executive.text.findings import Span, find_similar_word, suggest_choice
from executive.tree.flow import INITIAL_STATE, UNKNOWN_STATE, Flow, FlowState, compute_skill_flow, join_states
from executive.tree.node import ControlNode, ControlNodes
from executive.tree.specification import Node, Reference, SkillNode, SubtreeNode


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
        self._skills = skills
        self._is_first_tick = is_first_tick
        self._flows_by_entry: dict[tuple[str, FlowState], Flow] = {}
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
            case ControlNode():
                return node.compute_flow(self._analyse, state)
            case SkillNode():
                skill = self.find_skill_or_most_similar(node.skill)
                if skill is None:
                    return Flow.make_unknown(node.path, node.skill)
                outputs = [wire.variable for wire in find_wires(node, skill, Direction.OUT)]
                return compute_skill_flow(node, skill, outputs, state, self._is_first_tick)
            case SubtreeNode(body=Node() as body):
                flow = self._analyse(body, state)
                # In a loop, one use may start in several states.
                end_states = (self.body_end_states.get(node.path), flow.success)
                self.body_end_states[node.path] = join_states(end_states)
                # `find_unwritten_returns` reports unwritten returned variables, so they count as written.
                success = flow.success and flow.success.with_variables(node.written_variables)
                return replace(flow, success=success)
        for child in node.children:
            self._analyse(child, UNKNOWN_STATE)
        return Flow.make_unknown(node.path)


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
    failures = sorted(analysis.root_flow.failures, key=lambda end: (order[end.path], end.reason))
    spans = [analysis.nodes[failure.path].span for failure in failures]
    return tuple(
        UnhandledFailure(failure.source, failure.reason, failure.path, span.source.path, span.line)
        for failure, span in zip(failures, spans, strict=True)
    )


@dataclass(frozen=True)
class CheckContext:
    """A mission to check, with the installed skills and control nodes, and the cell.

    Attributes:
        mission: Content of the mission file, before expansion.
        tree: Expanded tree with paths; an `InvalidNode` if the tree could not be expanded.
        unused_subtrees: Expanded subtrees that the tree does not use.
        skills: Installed skills by name.
        node_classes: Installed control nodes by keyword.
        cell: Content of the cell file, or None if the file has errors.
        classes_by_detector: Classes that each detector of the cell can detect; None if unknown.
    """

    mission: Mission
    tree: Node
    unused_subtrees: tuple[Node, ...]
    skills: Skills
    node_classes: ControlNodes
    cell: CellConfig | None
    classes_by_detector: Mapping[str, tuple[str, ...] | None]

    @cached_property
    def flow_analysis(self) -> FlowAnalysis:
        """Possible states and failures of every node of the tree."""
        return FlowAnalysis(self.tree, self.skills)

    @cached_property
    def written_variables(self) -> set[str]:
        """Variables that a node of the tree may write."""
        return find_written_variables(self.tree, self.skills)

    @cached_property
    def nodes(self) -> Sequence[Node]:
        """Every node of the tree and of the unused subtrees."""
        return [node for root in (self.tree, *self.unused_subtrees) for node in root.walk()]

    @cached_property
    def control_nodes(self) -> Sequence[ControlNode]:
        """Every control node of the tree and of the unused subtrees."""
        return [node for node in self.nodes if isinstance(node, ControlNode)]

    def find_installed_skills(self, nodes: Iterable[Node]) -> Sequence[tuple[SkillNode, type[Skill]]]:
        """Return every node in `nodes` that runs an installed skill, with the skill."""
        skills = self.skills
        return [
            (node, skills[node.skill])
            for node in nodes
            if isinstance(node, SkillNode) and node.skill in skills
        ]

    def list_wires(self, root: Node, direction: Direction) -> Sequence[Wire]:
        """Return the connections of `root` and of the nodes below it to variables."""
        return [wire for node in root.walk() for wire in self.wires[node, direction]]

    @cached_property
    def names_in_cell_by_kind(self) -> Mapping[str, list[str]]:
        """Names of the bins, detectors, poses and classes of the cell, by kind; empty if `cell` is None."""
        if self.cell is None:
            return {}
        return {
            "bin": list(self.cell.bins),
            "detector": list(self.cell.detectors),
            "pose": list(self.cell.arm.poses_deg),
            "class": list(self.cell.objects),
        }

    @cached_property
    def library_uses_by_path(self) -> Mapping[str, SubtreeNode]:
        """By path of each node of a library: the `use` node of the mission file that includes the library."""
        uses: dict[str, SubtreeNode] = {}
        mission_source = self.tree.span.source
        for use in self.tree.walk():
            if isinstance(use, SubtreeNode) and use.span.source is mission_source:
                uses |= {node.path: use for node in use.walk() if node.span.source is not mission_source}
        return uses

    def locate_skill(self, node: SkillNode) -> tuple[str, Span]:
        """Return the name and the position of a skill in messages; for a skill in a library, of the `use`."""
        use = self.library_uses_by_path.get(node.path)
        return (f'{node.skill} in the subtree "{use.name}"', use.span) if use else (node.skill, node.span)

    def make_unknown_param_hint(self, reference: Reference) -> str:
        """Return the hint for a reference to a variable where only a param or an argument is allowed."""
        params = self.mission.params
        if reference.name in params:
            return (
                f"A library cannot use params: declare {reference.name} below args of the subtree, "
                "and give its value with `with`."
            )
        names = [f"${name}" for name in params]
        return suggest_choice(f"${reference.name}", names, "Params of the mission")

    def make_variable_hint(self, value: object) -> str:
        """Return the hint for a constant that is the name of a variable without `$`; "" for other values."""
        is_variable = isinstance(value, str) and value in self.written_variables
        return f"For the variable, write ${value}." if is_variable else ""

    @cached_property
    def wires(self) -> Mapping[tuple[Node, Direction], Sequence[Wire]]:
        """Connections of each node to variables, by node and direction."""
        written_variables = self.written_variables
        return {
            (node, direction): [
                wire
                for wire in find_node_wires(node, self.skills, direction)
                # `check_settings` reports a param with a variable that no node writes.
                if not isinstance(wire.port, Param) or wire.variable in written_variables
            ]
            for node in self.nodes
            for direction in Direction
        }

    def list_skills_with_output(self, name: str) -> str:
        """Return the names of the skills that have an output `name`, separated by commas."""
        outputs = {skill: self.skills[skill].ports.get(name) for skill in self.skills}
        return ", ".join(skill for skill, port in outputs.items() if port and port.direction is Direction.OUT)
