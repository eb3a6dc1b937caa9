"""Nodes that a failure passed, with the explanations why control nodes did not handle the failure."""

from __future__ import annotations

from dataclasses import dataclass

from executive.mission.model.instance import get_mission_node, make_inspection_instance
from executive.mission.model.node_paths import get_path_name
from executive.mission.model.nodes import InnerNode, Node, UseNode
from executive.record.timeline.activation import Activation
from executive.record.timeline.timeline import Timeline
from executive.tree.failure import Reason
from executive.tree.inspection import PropagatedFailure
from executive.tree.keys import Child
from executive.tree.node import ControlNode

_NEVER = Activation("", 0, "", "", "INVALID", 0, 0.0, 0, 0.0)
"""Activation of a node that never started."""


@dataclass(frozen=True)
class FailurePathNode:
    """Node that a failure passed on its way from the origin to the root of the tree.

    Attributes:
        node: The node of the mission.
        subtree: Name of the subtree that contains the node, or "".
        model: Instance of the control node for explanations; None for other nodes.
        failure: The failure that the node got from its child.
    """

    node: Node
    subtree: str
    model: ControlNode | None
    failure: PropagatedFailure

    @property
    def name(self) -> str:
        """Name of the node with its subtree: `look: retry`."""
        name = get_path_name(self.node)
        return f"{self.subtree}: {name}" if self.subtree else name

    @property
    def explanation(self) -> str:
        """Reason why the control node did not handle the failure; "" for other nodes."""
        return self.model.explain(self.failure) if self.model and self.failure.child else ""

    @property
    def attempt(self) -> tuple[int, int] | None:
        """Number of the failed attempt and maximum number of attempts; None if the node has no attempts."""
        return self.model.count_attempts(self.failure) if self.model else None


def find_failure_path(
    tree: Node, timeline: Timeline, origin: str, failure: str
) -> tuple[FailurePathNode, ...]:
    """Return the nodes that a failure passed, from the root to the origin.

    Args:
        tree: Root node of the mission.
        timeline: Timeline of the run.
        origin: Path of the node in which the failure began.
        failure: Name of the failure: `Grasp.missed`.
    """
    nodes = find_nodes_on_path(tree, origin)
    source, _, reason = failure.rpartition(".")
    names = {source}
    failure_path: list[FailurePathNode] = []
    for index in reversed(range(len(nodes))):
        node = nodes[index]
        child = nodes[index + 1] if index + 1 < len(nodes) else None
        subtree = next((use.name for use in reversed(nodes[:index]) if isinstance(use, UseNode)), "")
        model = make_inspection_instance(node) if isinstance(node, InnerNode) else None
        reasons = frozenset(Reason(name, reason) for name in names)
        propagated = _make_propagated_failure(timeline, node, model, child, reasons)
        failure_path.append(FailurePathNode(node, subtree, model, propagated))
        names |= {node.label} if node.label else set()
    return tuple(reversed(failure_path))


def _make_propagated_failure(
    timeline: Timeline, node: Node, model: ControlNode | None, child: Node | None, reasons: frozenset[Reason]
) -> PropagatedFailure:
    """Return the failure that `node` got from its child `child`; `child` is None at the origin."""
    activation = timeline.activation_by_path.get(node.path) or _NEVER
    children = [child for key in model.keys for child in model.list_children(key)] if model else []

    def has_failed(child: Child) -> bool:
        last = timeline.activation_by_path.get(get_mission_node(child).path)
        return last is not None and last.number > activation.number and last.status == "FAILURE"

    return PropagatedFailure(
        next((each for each in children if get_mission_node(each) is child), None),
        activation.reason, reasons, activation.handled_counts, activation.message_by_reason,
        activation.last_handled_reason, activation.choice, activation.end - activation.start, has_failed,
    )  # fmt: skip


def find_nodes_on_path(tree: Node, path: str) -> list[Node]:
    """Return the nodes from the root to the innermost node at `path`, or [] if no node has this path."""
    for child in tree.children:
        if nodes := find_nodes_on_path(child, path):
            return [tree, *nodes]
    return [tree] if tree.path == path else []
