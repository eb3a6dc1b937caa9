"""What a story is made of, put together once the run is over."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from executive.mission.model import nodes
from executive.mission.model.nodes import Node
from executive.record.progress import skill_name
from executive.record.story.chain import Link, chain, way
from executive.record.story.course import Activation, Course
from executive.record.story.items import ItemCourse

if TYPE_CHECKING:
    from executive.mission.load import LoadedMission
    from executive.runtime.outcome import Outcome


@dataclass(frozen=True)
class Case:
    """A run that did not succeed.

    Attributes:
        loaded: The mission.
        course: What happened.
        outcome: How it ended.
        links: The way of the failure that ended it, from the root to the node that decided; empty where the
            run ended otherwise.
        lost: The items whose loss ended it, by name.
    """

    loaded: LoadedMission
    course: Course
    outcome: Outcome
    links: tuple[Link, ...]
    lost: Mapping[str, ItemCourse]

    @staticmethod
    def of(loaded: LoadedMission, course: Course, outcome: Outcome) -> Case:
        """Return the case of a run that is over."""
        failed = outcome.status == "FAILURE"
        links = chain(loaded.tree, course, outcome.node, outcome.reason) if failed else ()
        lost = course.items.lost() if failed and not outcome.node else {}
        return Case(loaded, course, outcome, links, lost)

    @property
    def decided(self) -> Activation | None:
        """The last activation of the node that decided; None where none did."""
        return self.course.node(self.outcome.node)

    @property
    def node(self) -> Node | None:
        """The node that decided, as the mission has it; None where none did."""
        return next(iter(way(self.loaded.tree, self.outcome.node)[-1:]), None)

    @property
    def running(self) -> tuple[str, ...]:
        """Paths of the skills that ran until they were halted, by the end of the run or the deciding node."""
        if self.outcome.status != "FAILURE":
            return self.course.cut
        return self.decided.cut if self.decided is not None else ()

    @property
    def item(self) -> str:
        """What it was all about, or ""."""
        activations = [self.decided, *map(self.course.node, self.running)]
        about = [ran.item for ran in activations if ran is not None and ran.item]
        return next(iter([*about, *self.lost]), "")

    @property
    def file(self) -> str:
        """The mission file, as findings call it."""
        return self.loaded.tree.mark.source.path

    def named(self, path: str) -> str:
        """Return what a person calls a skill that ran: `Grasp of cube-1`."""
        ran = self.course.node(path)
        return skill_name(path) + (f" of {ran.item}" if ran is not None and ran.item else "")

    def place(self, node: Node) -> str:
        """Return where a node stands: the line, and the file where it is not the mission's."""
        return node.mark.place(self.loaded.tree.mark.source)

    @property
    def is_skill(self) -> bool:
        """True where a skill decided."""
        return isinstance(self.node, nodes.SkillNode)
