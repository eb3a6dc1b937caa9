"""Run that did not succeed, in the terms of its mission, and the cause of its end."""

from __future__ import annotations

from typing import TYPE_CHECKING

from executive.errors import RecordLost
from executive.events import RunEnded
from executive.mission.model.nodes import Node, SkillNode
from executive.record.diagnosis.chain import find_nodes_on_path, trace_failure
from executive.record.timeline.activation import to_skill_name
from executive.record.timeline.timeline import Timeline

if TYPE_CHECKING:
    from executive.mission.load import LoadedMission

MAX_NAMED_ITEMS = 5
"""Maximum number of items in a sentence."""


class FailedRun:
    """Run that did not succeed, in the terms of its mission.

    Args:
        loaded: The mission.
        timeline: Timeline of the run.
        end: End of the run.

    Attributes:
        links: Nodes that the failure passed, from the root to its origin; empty if the tree did not fail.
        lost: Items whose loss ended the run, by name.
        decided: Last activation of the node that determined the status, or None.
        node: Node of the mission that determined the status, or None.
        running: Paths of the skills that were halted by the end of the run or by `node`.
        item: Item that `node` worked on, or "".
        is_unrecorded: True if the run ended because the journal could not be written.
    """

    def __init__(self, loaded: LoadedMission, timeline: Timeline, end: RunEnded) -> None:
        self.loaded, self.timeline, self.end = loaded, timeline, end
        failed = end.status == "FAILURE"
        self.links = trace_failure(loaded.tree, timeline, end.node, end.reason) if failed else ()
        self.lost = {
            name: item
            for name, item in timeline.items.by_name.items()
            if failed and not end.node and item.last_change.state == "lost"
        }
        self.decided = timeline.nodes.get(end.node)
        self.node = next(iter(find_nodes_on_path(loaded.tree, end.node)[-1:]), None)
        self.running = timeline.halted
        if failed:
            self.running = self.decided.halted if self.decided is not None else ()
        activations = [self.decided, *map(timeline.nodes.get, self.running)]
        about = [ran.item for ran in activations if ran is not None and ran.item]
        self.item = next(iter([*about, *self.lost]), "")
        self.is_unrecorded = f".{RecordLost.__name__}: " in timeline.traceback

    def name_skill(self, path: str) -> str:
        """Return the name of a skill with the item of its last activation: `Grasp of cube-1`."""
        ran = self.timeline.nodes.get(path)
        return to_skill_name(path) + (f" of {ran.item}" if ran is not None and ran.item else "")

    def locate(self, node: Node) -> str:
        """Return the line of a node, and the file if it is not that of the mission."""
        return node.mark.place(self.loaded.tree.mark.source)


def verdict(case: FailedRun) -> str:
    """Return the cause of the end of a run in one sentence: skill, item, number of attempts and message."""
    end = case.end
    running = " and ".join(map(case.name_skill, case.running))
    during = f" during {running}" if running else ""
    if end.status == "HALTED":
        return end.message + (
            " while the operator was asked" if case.timeline.question is not None else during
        )
    if case.lost:
        were = "object was" if len(case.lost) == 1 else "objects were"
        more = f" and {len(case.lost) - MAX_NAMED_ITEMS} more" if len(case.lost) > MAX_NAMED_ITEMS else ""
        return f"{len(case.lost)} {were} lost: {', '.join(list(case.lost)[:MAX_NAMED_ITEMS])}{more}"
    if not case.links:
        return end.message
    if isinstance(case.node, SkillNode):
        reason = end.reason.rpartition(".")[2]
        return f"{case.name_skill(end.node)} failed ({reason}){_describe_attempt(case)}: {end.message}"
    return f"{case.links[-1].name}{_describe_attempt(case)}: {end.message}{during}"


def _describe_attempt(case: FailedRun) -> str:
    """Return the failed attempt of the innermost node that counts attempts; "" for the first attempt."""
    attempts = next((link.attempt for link in reversed(case.links) if link.attempt), None)
    if attempts is None:
        return ""
    attempt, max_attempts = attempts
    if attempt == 1:
        return ""
    return (
        f" on the last of {max_attempts} attempts"
        if attempt == max_attempts
        else f" on attempt {attempt} of {max_attempts}"
    )
