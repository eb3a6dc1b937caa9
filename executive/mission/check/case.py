"""What the checks look at."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

from executive.cell.config import CellConfig
from executive.cell.protocols import MinTimes
from executive.mission.findings import alternatives
from executive.mission.flow.analysis import Analysis
from executive.mission.model.mission import Mission
from executive.mission.model.nodes import InnerNode, Node, SkillNode, UseNode
from executive.mission.model.values import Reference
from executive.mission.model.wiring import Wire, find_all_written_variables, find_wires
from executive.skill import Direction, Skill
from executive.tree.registry import ControlNodes


@dataclass(frozen=True)
class Case:
    """A mission before a check.

    Attributes:
        mission: As written.
        tree: The tree that runs, expanded, with paths; an unknown node where it could not be read.
        unused: Expanded subtrees that nothing uses.
        skills: Installed skills by name.
        control: Installed control nodes by keyword.
        cell: The cell, or None where its file has findings of its own.
        labels: For every detector of the cell the classes its model knows, None where it cannot be known.
        min_times: Lower bounds of what things take in the cell, or None where they are not known.
    """

    mission: Mission
    tree: Node
    unused: tuple[Node, ...]
    skills: Mapping[str, type[Skill]]
    control: ControlNodes
    cell: CellConfig | None
    labels: Mapping[str, tuple[str, ...] | None]
    min_times: MinTimes | None

    @cached_property
    def flow(self) -> Analysis:
        """Faults that can happen in the tree of this run."""
        return Analysis(self.tree, self.skills)

    @cached_property
    def written(self) -> set[str]:
        """Variables that something in the tree may write."""
        return find_all_written_variables(self.tree, self.skills)

    def nodes(self) -> Iterator[Node]:
        """Yield every node, also of the subtrees that nothing uses."""
        for root in (self.tree, *self.unused):
            yield from root.walk()

    def inner_nodes(self) -> Iterator[InnerNode]:
        """Yield every control node, also of the subtrees that nothing uses."""
        return (node for node in self.nodes() if isinstance(node, InnerNode))

    def known_skills(self) -> Iterator[tuple[SkillNode, type[Skill]]]:
        """Yield every node that names an installed skill, with the skill."""
        for node in self.nodes():
            if isinstance(node, SkillNode) and node.skill in self.skills:
                yield node, self.skills[node.skill]

    @cached_property
    def names(self) -> Mapping[str, list[str]]:
        """The names of everything in the cell that a mission can refer to, by kind."""
        if self.cell is None:
            return {}
        return {
            "bin": list(self.cell.bins),
            "detector": list(self.cell.detectors),
            "pose": list(self.cell.arm.poses_deg),
            "class": list(self.cell.objects),
        }

    @cached_property
    def library_uses(self) -> Mapping[str, UseNode]:
        """For every node that stands in a library, the `use` in the mission's own file that leads to it."""
        uses: dict[str, UseNode] = {}

        def walk(node: Node, use: UseNode | None) -> None:
            if node.mark.source is own:
                use = node if isinstance(node, UseNode) else None
            elif use is not None:
                uses[node.path] = use
            for child in node.children:
                walk(child, use)

        own = self.tree.mark.source
        walk(self.tree, None)
        return uses

    def constant_hint(self, reference: Reference) -> str:
        """Return what to write where a variable stands in the place of a constant."""
        params = self.mission.params
        if reference.name in params:
            return "A library sees its own arguments only: declare it under args and give it with `with`."
        return alternatives(f"${reference.name}", [f"${name}" for name in params], "The mission's params")

    def variable_hint(self, word: object) -> str:
        """Return what to write where the name of a variable lacks its `$`, or ""."""
        is_written = isinstance(word, str) and word in self.written
        return f"For the variable write ${word}." if is_written else ""

    def find_wires(self, node: Node, direction: Direction) -> Iterator[Wire]:
        """Yield the variables that a node reads or writes through the ports of its skill, if it is one."""
        if isinstance(node, SkillNode) and node.skill in self.skills:
            yield from find_wires(node, self.skills[node.skill], direction)
