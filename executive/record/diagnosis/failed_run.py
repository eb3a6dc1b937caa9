"""Run that did not succeed: failure path, deciding node, lost items and cause of the end."""

from __future__ import annotations

from dataclasses import dataclass

from executive.errors import RecordLost
from executive.events import RunEnded
from executive.mission.load import LoadedMission
from executive.mission.model.instance import get_mission_node, make_inspection_instance
from executive.mission.model.nodes import InnerNode, Node, SkillNode, SubtreeNode
from executive.record.timeline.activation import Activation, get_skill_name
from executive.record.timeline.timeline import Timeline
from executive.tree.failure import Reason
from executive.tree.inspection import PropagatedFailure
from executive.tree.node import ControlNode

MAX_NAMED_ITEMS = 5
"""Maximum number of item names in a sentence."""

_NO_ACTIVATION = Activation("", 0, "", "", "INVALID", 0, 0.0, 0, 0.0)
"""Substitute for the activation of a node that never started."""


@dataclass(frozen=True)
class FailurePathNode:
    """Node from which a failure propagated to its parent.

    Attributes:
        node: Node of the mission.
        subtree: Name of the subtree that contains the node, or "".
        control_node: Instance that never runs and only explains the decision of `node`; None if `node` is not
            a control node.
        failure: Failure that the node received from its child.
    """

    node: Node
    subtree: str
    control_node: ControlNode | None
    failure: PropagatedFailure

    @property
    def name(self) -> str:
        """Name of the node with its subtree: `look: retry`."""
        name = self.node.path_name
        return f"{self.subtree}: {name}" if self.subtree else name

    @property
    def explanation(self) -> str:
        """Reason why the control node did not handle the failure; "" for other nodes."""
        return self.control_node.explain(self.failure) if self.control_node and self.failure.child else ""

    @property
    def attempt(self) -> tuple[int, int] | None:
        """Number of the failed attempt and maximum number of attempts; None if the node has no attempts."""
        return self.control_node.count_attempts(self.failure) if self.control_node else None


class FailedRun:
    """Mission, timeline and end of a run that did not succeed.

    Attributes:
        failure_path: Nodes from the root to the origin of the failure; empty if no node of the tree failed.
        lost_items: History of the items whose loss made the run fail, by name of the item.
        deciding_activation: Last activation of the node that determined the status, or None.
        deciding_node: Node of the mission that determined the status, or None.
        halted_skills: Paths of the skills that the end of the run or `deciding_node` halted.
        item: Name of the item of `deciding_node`, else of a halted skill, else of the first lost item, or "".
        is_record_lost: True if the run ended because the journal could not be written.
    """

    def __init__(self, loaded: LoadedMission, timeline: Timeline, end: RunEnded) -> None:
        self.loaded, self.timeline, self.end = loaded, timeline, end
        is_failure, tree = end.status == "FAILURE", loaded.tree
        self.failure_path = find_failure_path(tree, timeline, end) if is_failure else []
        # Lost items make a run fail after its tree has succeeded; then no node determined the status.
        self.lost_items = {
            name: item
            for name, item in timeline.items.by_name.items()
            if is_failure and not end.node and item.last_change.state == "lost"
        }
        self.deciding_activation = timeline.activation_by_path.get(end.node)
        self.deciding_node = next(iter(find_nodes_on_path(tree, end.node)[-1:]), None)
        self.halted_skills = timeline.halted_skills
        if is_failure:
            self.halted_skills = self.deciding_activation.halted_skills if self.deciding_activation else ()
        activations = [self.deciding_activation, *map(timeline.activation_by_path.get, self.halted_skills)]
        items = [activation.item for activation in activations if activation is not None and activation.item]
        self.item = next(iter([*items, *self.lost_items]), "")
        # The last line of a traceback is `module.RecordLost: message`.
        self.is_record_lost = f".{RecordLost.__name__}: " in timeline.traceback

    def format_skill_name(self, path: str) -> str:
        """Return the name of a skill with the item of its last activation: `Grasp of cube-1`."""
        last = self.timeline.activation_by_path.get(path)
        return get_skill_name(path) + (f" of {last.item}" if last is not None and last.item else "")

    def format_location(self, node: Node) -> str:
        """Return the location of a node: the line number, and the file name if it is not the mission file."""
        return node.span.describe_place(self.loaded.tree.span.source)


def describe_cause(run: FailedRun) -> str:
    """Return a sentence with the cause of the end: lost items, or skill, attempt and message."""
    end = run.end
    skills = " and ".join(map(run.format_skill_name, run.halted_skills))
    skills_text = f" during {skills}" if skills else ""
    if end.status == "HALTED":
        return end.message + (" while the operator was asked" if run.timeline.question else skills_text)
    if names := list(run.lost_items):
        subject = "object was" if len(names) == 1 else "objects were"
        omitted = f" and {len(names) - MAX_NAMED_ITEMS} more" if len(names) > MAX_NAMED_ITEMS else ""
        return f"{len(names)} {subject} lost: {', '.join(names[:MAX_NAMED_ITEMS])}{omitted}"
    if not run.failure_path:
        return end.message
    if isinstance(run.deciding_node, SkillNode):
        reason = end.reason.rpartition(".")[2]
        return f"{run.format_skill_name(end.node)} failed ({reason}){_describe_attempt(run)}: {end.message}"
    return f"{run.failure_path[-1].name}{_describe_attempt(run)}: {end.message}{skills_text}"


def _describe_attempt(run: FailedRun) -> str:
    """Return the number of the failed attempt of the innermost retry as text; "" for the first attempt."""
    attempts = (entry.attempt for entry in reversed(run.failure_path) if entry.attempt)
    attempt, max_attempts = next(attempts, (1, 1))
    if attempt == 1:
        return ""
    if attempt == max_attempts:
        return f" on the last of {max_attempts} attempts"
    return f" on attempt {attempt} of {max_attempts}"


def find_failure_path(tree: Node, timeline: Timeline, end: RunEnded) -> list[FailurePathNode]:
    """Return the nodes through which the failure of a run propagated, from the root to the origin.

    `end.node` is the path of the node in which the failure began; `end.reason` is the name of the failure.
    """
    nodes = find_nodes_on_path(tree, end.node)
    skill_or_label, _, reason = end.reason.rpartition(".")
    # For the ancestors of a node with a label, the failure may also have the name `label.reason`.
    source_names = {skill_or_label}
    failure_path: list[FailurePathNode] = []
    for index, node in reversed(list(enumerate(nodes))):
        child = nodes[index + 1] if index + 1 < len(nodes) else None
        ancestors = reversed(nodes[:index])
        subtree = next((ancestor.name for ancestor in ancestors if isinstance(ancestor, SubtreeNode)), "")
        control_node = make_inspection_instance(node) if isinstance(node, InnerNode) else None
        reasons = frozenset(Reason(source, reason) for source in source_names)
        propagated = _make_propagated_failure(timeline, node.path, control_node, child, reasons)
        failure_path.append(FailurePathNode(node, subtree, control_node, propagated))
        source_names |= {node.label} if node.label else set()
    return failure_path[::-1]


def _make_propagated_failure(
    timeline: Timeline, path: str, control: ControlNode | None, child: Node | None, reasons: frozenset[Reason]
) -> PropagatedFailure:
    """Return the failure that the node at `path` received from `child`; at the origin, `child` is None."""
    activation = timeline.activation_by_path.get(path) or _NO_ACTIVATION
    children = [entry for key in control.keys for entry in control.list_children(key)] if control else []
    return PropagatedFailure(
        child=next((entry for entry in children if get_mission_node(entry) is child), None),
        name=activation.reason, reasons=reasons, handled_counts=activation.handled_counts,
        last_messages=activation.message_by_reason, last_handled_name=activation.last_handled_reason,
        last_choice=activation.choice, duration=activation.end - activation.start,
    )  # fmt: skip


def find_nodes_on_path(tree: Node, path: str) -> list[Node]:
    """Return the nodes from the root to the node at `path`, or [] if no node has this path.

    If a subtree and its body have this path, both are returned, the body last.
    """
    for child in tree.children:
        if nodes := find_nodes_on_path(child, path):
            return [tree, *nodes]
    return [tree] if tree.path == path else []
