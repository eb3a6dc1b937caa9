"""Path of a failure through the tree, from the root to its origin, with explanations of the control nodes."""

from __future__ import annotations

from dataclasses import dataclass

from executive.mission.model.instance import inspection_instance, node_of
from executive.mission.model.nodes import InnerNode, Node, UseNode
from executive.mission.model.paths import name_of
from executive.record.timeline.activation import Activation
from executive.record.timeline.timeline import Timeline
from executive.tree.failure import Reason
from executive.tree.inspection import PropagatedFailure
from executive.tree.keys import Child
from executive.tree.node import ControlNode

_NEVER = Activation("", 0, "", "", "INVALID", 0, 0.0, 0, 0.0)
"""Activation of a node that never started."""


@dataclass(frozen=True)
class Link:
    """Node that a failure passed.

    Attributes:
        node: The node of the mission.
        subtree: Name of the subtree that contains the node, or "".
        model: Control node that explains failures; None for other nodes.
        failure: The failure as input of the node.
    """

    node: Node
    subtree: str
    model: ControlNode | None
    failure: PropagatedFailure

    @property
    def name(self) -> str:
        """Name of the node in a report: `look: retry`."""
        name = name_of(self.node)
        return f"{self.subtree}: {name}" if self.subtree else name

    @property
    def why(self) -> str:
        """Reason why a control node did not handle the failure; "" for other nodes."""
        return self.model.explain(self.failure) if self.model and self.failure.child else ""

    @property
    def attempt(self) -> tuple[int, int] | None:
        """Number of the failed attempt and number of allowed attempts; None if the node counts none."""
        return self.model.count_attempts(self.failure) if self.model else None


def trace_failure(tree: Node, timeline: Timeline, origin: str, failure: str) -> tuple[Link, ...]:
    """Return the nodes that a failure passed, from the root to the origin.

    Args:
        tree: The mission's tree.
        timeline: Timeline of the run.
        origin: Path of the node in which the failure began.
        failure: Name of the failure: `Grasp.missed`.
    """
    passed = find_nodes_on_path(tree, origin)
    source, _, reason = failure.rpartition(".")
    names = {source}
    links: list[Link] = []
    for index in reversed(range(len(passed))):
        node = passed[index]
        below = passed[index + 1] if index + 1 < len(passed) else None
        subtree = next((above.name for above in reversed(passed[:index]) if isinstance(above, UseNode)), "")
        model = inspection_instance(node) if isinstance(node, InnerNode) else None
        reasons = frozenset(Reason(name, reason) for name in names)
        links.append(Link(node, subtree, model, _make_passed_failure(timeline, node, model, below, reasons)))
        names |= {node.label} if node.label else set()
    return tuple(reversed(links))


def _make_passed_failure(
    timeline: Timeline, node: Node, model: ControlNode | None, below: Node | None, reasons: frozenset[Reason]
) -> PropagatedFailure:
    """Return the failure as input of a node; `below` is the child that failed, or None at the origin."""
    ran = timeline.nodes.get(node.path) or _NEVER
    children = [child for key in model.keys for child in model.list_children(key)] if model else []

    def has_failed(child: Child) -> bool:
        last = timeline.nodes.get(node_of(child).path)
        return last is not None and last.number > ran.number and last.status == "FAILURE"

    return PropagatedFailure(
        next((child for child in children if node_of(child) is below), None),
        ran.reason, reasons, ran.handled_counts, ran.message_by_reason, ran.last_handled, ran.choice,
        ran.end - ran.start, has_failed,
    )  # fmt: skip


def find_nodes_on_path(tree: Node, path: str) -> list[Node]:
    """Return the nodes from the root to the innermost node at a path; empty if there is no such node."""
    for child in tree.children:
        if nodes := find_nodes_on_path(child, path):
            return [tree, *nodes]
    return [tree] if tree.path == path else []
