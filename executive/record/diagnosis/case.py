"""Case of a run that did not succeed, put together once the run is over, and its verdict."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from executive.events import RunEnded
from executive.mission.model import nodes
from executive.mission.model.nodes import Node
from executive.record.diagnosis.chain import attempts, chain, way
from executive.record.diagnosis.course import Course
from executive.record.progress import skill_name

if TYPE_CHECKING:
    from executive.mission.load import LoadedMission

MOST = 5
"""Items that a sentence names one by one."""


class Case:
    """A run that did not succeed.

    Args:
        loaded: The mission.
        course: Its events.
        outcome: Its end.

    Attributes:
        links: The way of the failure that ended it, from the root to the node that decided; empty where the
            run ended otherwise.
        lost: The items whose loss ended it, by name.
        decided: The last activation of the node that decided; None where none did.
        node: The node that decided, as the mission has it; None where none did.
        running: Paths of the skills that ran until they were halted, by the end of the run or the deciding
            node.
        item: The item it was all about, or "".
    """

    def __init__(self, loaded: LoadedMission, course: Course, outcome: RunEnded) -> None:
        self.loaded, self.course, self.outcome = loaded, course, outcome
        failed = outcome.status == "FAILURE"
        self.links = chain(loaded.tree, course, outcome.node, outcome.reason) if failed else ()
        self.lost = course.items.lost() if failed and not outcome.node else {}
        self.decided = course.node(outcome.node)
        self.node = next(iter(way(loaded.tree, outcome.node)[-1:]), None)
        self.running: Sequence[str] = course.cut
        if failed:
            self.running = self.decided.cut if self.decided is not None else ()
        activations = [self.decided, *map(course.node, self.running)]
        about = [ran.item for ran in activations if ran is not None and ran.item]
        self.item = next(iter([*about, *self.lost]), "")

    def named(self, path: str) -> str:
        """Return what a person calls a skill that ran: `Grasp of cube-1`."""
        ran = self.course.node(path)
        return skill_name(path) + (f" of {ran.item}" if ran is not None and ran.item else "")

    def place(self, node: Node) -> str:
        """Return where a node stands: the line, and the file where it is not the mission's."""
        return node.mark.place(self.loaded.tree.mark.source)


def verdict(case: Case) -> str:
    """Return in one sentence what ended a run: what failed, on what, how often it was tried, and why."""
    outcome = case.outcome
    running = " and ".join(map(case.named, case.running))
    during = f" during {running}" if running else ""
    if outcome.status == "HALTED":
        return outcome.message + (" while the operator was asked" if case.course.asking else during)
    if case.lost:
        were = "object was" if len(case.lost) == 1 else "objects were"
        more = f" and {len(case.lost) - MOST} more" if len(case.lost) > MOST else ""
        return f"{len(case.lost)} {were} lost: {', '.join(list(case.lost)[:MOST])}{more}"
    if not case.links:
        return outcome.message
    if isinstance(case.node, nodes.SkillNode):
        reason = outcome.reason.rpartition(".")[2]
        return f"{case.named(outcome.node)} failed ({reason}){_tried(case)}: {outcome.message}"
    return f"{case.links[-1].name}{_tried(case)}: {outcome.message}{during}"


def _tried(case: Case) -> str:
    """Return how often it was tried, as the innermost retry counted; "" for the first time."""
    retry = next((link for link in reversed(case.links) if isinstance(link.node, nodes.RetryNode)), None)
    if retry is None:
        return ""
    attempt, most = attempts(retry)
    if attempt == 1:
        return ""
    return f" on the last of {most} attempts" if attempt == most else f" on attempt {attempt} of {most}"
