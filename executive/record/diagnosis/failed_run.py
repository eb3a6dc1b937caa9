"""Run that did not succeed: its failure, the deciding node of its mission, and the cause of its end."""

from __future__ import annotations

from typing import TYPE_CHECKING

from executive.errors import RecordLost
from executive.events import RunEnded
from executive.mission.model.nodes import Node, SkillNode
from executive.record.diagnosis.failure_path import find_failure_path, find_nodes_on_path
from executive.record.timeline.activation import get_skill_name
from executive.record.timeline.timeline import Timeline

if TYPE_CHECKING:
    from executive.mission.load import LoadedMission

MAX_NAMED_ITEMS = 5
"""Maximum number of item names in a sentence."""


class FailedRun:
    """Run that did not succeed, with its mission.

    Args:
        loaded: The mission.
        timeline: Timeline of the run.
        end: End of the run.

    Attributes:
        failure_path: Nodes that the failure passed, from the root to its origin; empty without a failure.
        lost_items: History of the items whose loss made the run fail, by name of the item.
        deciding_activation: Last activation of the node that determined the status, or None.
        deciding_node: Node of the mission that determined the status, or None.
        halted_skills: Paths of the skills that the end of the run or `deciding_node` halted.
        item: Item that `deciding_node` worked on, or "".
        is_record_lost: True if the run ended because the journal could not be written.
    """

    def __init__(self, loaded: LoadedMission, timeline: Timeline, end: RunEnded) -> None:
        self.loaded, self.timeline, self.end = loaded, timeline, end
        failed = end.status == "FAILURE"
        self.failure_path = find_failure_path(loaded.tree, timeline, end.node, end.reason) if failed else ()
        self.lost_items = {
            name: item
            for name, item in timeline.items.by_name.items()
            if failed and not end.node and item.last_change.state == "lost"
        }
        self.deciding_activation = timeline.activation_by_path.get(end.node)
        self.deciding_node = next(iter(find_nodes_on_path(loaded.tree, end.node)[-1:]), None)
        self.halted_skills = timeline.halted_skills
        deciding = self.deciding_activation
        if failed:
            self.halted_skills = deciding.halted_skills if deciding is not None else ()
        activations = [deciding, *map(timeline.activation_by_path.get, self.halted_skills)]
        items = [activation.item for activation in activations if activation is not None and activation.item]
        self.item = next(iter([*items, *self.lost_items]), "")
        self.is_record_lost = f".{RecordLost.__name__}: " in timeline.traceback

    def format_skill_name(self, path: str) -> str:
        """Return the name of a skill with the item of its last activation: `Grasp of cube-1`."""
        last = self.timeline.activation_by_path.get(path)
        return get_skill_name(path) + (f" of {last.item}" if last is not None and last.item else "")

    def format_place(self, node: Node) -> str:
        """Return the line of a node in its file, with the file name if it is not the mission file."""
        return node.span.describe_place(self.loaded.tree.span.source)


def describe_cause(run: FailedRun) -> str:
    """Return the cause of the end of a run in one sentence: skill, item, number of attempts and message."""
    end = run.end
    skills = " and ".join(map(run.format_skill_name, run.halted_skills))
    during = f" during {skills}" if skills else ""
    if end.status == "HALTED":
        return end.message + (" while the operator was asked" if run.timeline.question else during)
    if names := list(run.lost_items):
        subject = "object was" if len(names) == 1 else "objects were"
        more = f" and {len(names) - MAX_NAMED_ITEMS} more" if len(names) > MAX_NAMED_ITEMS else ""
        return f"{len(names)} {subject} lost: {', '.join(names[:MAX_NAMED_ITEMS])}{more}"
    if not run.failure_path:
        return end.message
    if isinstance(run.deciding_node, SkillNode):
        reason = end.reason.rpartition(".")[2]
        return f"{run.format_skill_name(end.node)} failed ({reason}){_describe_attempt(run)}: {end.message}"
    return f"{run.failure_path[-1].name}{_describe_attempt(run)}: {end.message}{during}"


def _describe_attempt(run: FailedRun) -> str:
    """Return a text about the failed attempt of the innermost node that counts attempts; "" for attempt 1."""
    attempts = next((entry.attempt for entry in reversed(run.failure_path) if entry.attempt), None)
    if attempts is None:
        return ""
    attempt, max_attempts = attempts
    if attempt == 1:
        return ""
    if attempt == max_attempts:
        return f" on the last of {max_attempts} attempts"
    return f" on attempt {attempt} of {max_attempts}"
