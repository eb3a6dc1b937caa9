"""What the checks look at."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from executive.cell_config import CellConfig
from executive.mission.model import Mission, Node, SkillNode
from executive.skill import Skill


@dataclass(frozen=True)
class Case:
    """A mission before a check.

    Attributes:
        mission: As written.
        tree: The tree that runs, expanded.
        unused: Expanded subtrees that nothing uses.
        skills: Installed skills by name.
        cell: The cell, or None where its file has findings of its own.
    """

    mission: Mission
    tree: Node | None
    unused: tuple[Node, ...]
    skills: Mapping[str, type[Skill]]
    cell: CellConfig | None

    def nodes(self) -> Iterator[Node]:
        """Yield every node, also of the subtrees that nothing uses."""
        for root in (self.tree, *self.unused):
            if root is not None:
                yield from root.walk()

    def known_skills(self) -> Iterator[tuple[SkillNode, type[Skill]]]:
        """Yield every node that names an installed skill, with the skill."""
        for node in self.nodes():
            if isinstance(node, SkillNode) and node.skill in self.skills:
                yield node, self.skills[node.skill]
