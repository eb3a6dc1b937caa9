"""Failure path: nodes from the root to the origin of a failure, which no control node handled."""

from __future__ import annotations

from dataclasses import dataclass

from executive.mission.model.instance import get_mission_node, make_inspection_instance
from executive.mission.model.nodes import InnerNode, Node, SubtreeNode
from executive.record.timeline.activation import Activation
from executive.record.timeline.timeline import Timeline
from executive.tree.failure import Reason
from executive.tree.inspection import PropagatedFailure
from executive.tree.node import ControlNode

_NO_ACTIVATION = Activation("", 0, "", "", "INVALID", 0, 0.0, 0, 0.0)
"""Substitute for the activation of a node that never started."""


@dataclass(frozen=True)
class FailurePathNode:
    """Node from which a failure propagated to its parent.

    Attributes:
        node: Node of the mission.
        subtree: Name of the subtree that contains the node, or "".
        control_node: Instance that explains the decision of a control node; None for other nodes.
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


def find_failure_path(tree: Node, timeline: Timeline, origin: str, failure: str) -> list[FailurePathNode]:
    """Return the nodes through which a failure propagated, from the root to the origin.

    `origin` is the path of the node in which the failure with the name `failure` (`Grasp.missed`) began.
    """
    nodes = find_nodes_on_path(tree, origin)
    skill_or_label, _, reason = failure.rpartition(".")
    # Above a node with a label, the mission may use this label in the name of the failure.
    source_names = {skill_or_label}
    failure_path: list[FailurePathNode] = []
    for index in reversed(range(len(nodes))):
        node = nodes[index]
        child = nodes[index + 1] if index + 1 < len(nodes) else None
        subtree = next((each.name for each in reversed(nodes[:index]) if isinstance(each, SubtreeNode)), "")
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
    children = [each for key in control.keys for each in control.list_children(key)] if control else []
    return PropagatedFailure(
        child=next((each for each in children if get_mission_node(each) is child), None),
        name=activation.reason, reasons=reasons, handled_counts=activation.handled_counts,
        last_messages=activation.message_by_reason, last_handled_name=activation.last_handled_reason,
        last_choice=activation.choice, duration=activation.end - activation.start,
    )  # fmt: skip


def find_nodes_on_path(tree: Node, path: str) -> list[Node]:
    """Return the nodes from the root to the innermost node at `path`, or [] if no node has this path."""
    for child in tree.children:
        if nodes := find_nodes_on_path(child, path):
            return [tree, *nodes]
    return [tree] if tree.path == path else []
