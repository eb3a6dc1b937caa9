"""Input of the checks: the mission, the installed skills and control nodes, and the cell."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from executive.cell.config import CellConfig
from executive.mission.findings import suggest_choice
from executive.mission.flow_analysis import FlowAnalysis
from executive.mission.model.mission import Mission
from executive.mission.model.nodes import InnerNode, Node, SkillNode, SubtreeNode
from executive.mission.model.values import Reference
from executive.mission.model.wiring import Wire, find_control_node_inputs, find_wires, find_written_variables
from executive.mission.source import Span
from executive.skill import Direction, Port, Skill
from executive.tree.node_registry import ControlNodes


class VariableRead(NamedTuple):
    """A read of a variable by a node.

    Attributes:
        node: Node that reads the variable.
        input_name: Name in messages: `Approach.target`, or the keyword of a control node.
        variable: Name of the variable.
        span: Position of the variable; position of the skill if the mission names no variable.
        is_explicit: True if the mission names the variable.
        is_required: True if the input has no default.
    """

    node: Node
    input_name: str
    variable: str
    span: Span
    is_explicit: bool
    is_required: bool


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
    skills: Mapping[str, type[Skill]]
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

    def iterate_nodes(self) -> Iterator[Node]:
        """Yield every node of the tree and of the unused subtrees."""
        for root in (self.tree, *self.unused_subtrees):
            yield from root.walk()

    def iterate_control_nodes(self) -> Iterator[InnerNode]:
        """Yield every control node of the tree and of the unused subtrees."""
        return (node for node in self.iterate_nodes() if isinstance(node, InnerNode))

    def find_installed_skills(self, nodes: Iterable[Node]) -> Iterator[tuple[SkillNode, type[Skill]]]:
        """Yield every node in `nodes` that runs an installed skill, with the skill."""
        for node in nodes:
            if isinstance(node, SkillNode) and node.skill in self.skills:
                yield node, self.skills[node.skill]

    def iterate_reads(self, root: Node) -> Iterator[VariableRead]:
        """Yield every read of a variable by `root` and the nodes below it."""
        for node in root.walk():
            for reference in find_control_node_inputs(node):
                yield VariableRead(node, node.type_name, reference.name, reference.span, True, False)
            for wire in self.find_wires(node, Direction.IN):
                flags = wire.is_explicit, wire.port.is_required
                yield VariableRead(node, str(wire), wire.variable, wire.span, *flags)

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

    def find_wires(self, node: Node, direction: Direction) -> Iterator[Wire]:
        """Yield the connections of the ports of a node; none if the node is no installed skill."""
        if isinstance(node, SkillNode) and node.skill in self.skills:
            for wire in find_wires(node, self.skills[node.skill], direction):
                # `check_settings` reports a param with a variable that no node writes.
                if isinstance(wire.port, Port) or wire.variable in self.written_variables:
                    yield wire
