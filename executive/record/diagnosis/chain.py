"""The way of a failure from the root of the tree to the node that decided, and why nothing stopped it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from executive.mission.model.instance import inspection_instance, node_of
from executive.mission.model.nodes import InnerNode, Node, UseNode
from executive.mission.model.paths import name_of
from executive.record.timeline.activation import Activation
from executive.record.timeline.timeline import Timeline
from executive.tree.failure import Reason
from executive.tree.inspection import PassedFailure
from executive.tree.keys import Child
from executive.tree.node import ControlNode

_NEVER = Activation("", 0, "", "", "INVALID", 0, 0.0, 0, 0.0)
"""Stands for the activation of a node that never started."""


@dataclass(frozen=True)
class Link:
    """One node on the way.

    Attributes:
        node: The node of the mission.
        subtree: Name of the subtree it stands in, or "".
        model: Its control node, which explains failures; None for any other node.
        failure: The failure as this node saw it.
    """

    node: Node
    subtree: str
    model: ControlNode | None
    failure: PassedFailure

    @property
    def name(self) -> str:
        """Its name in a report: `look: retry`."""
        name = name_of(self.node)
        return f"{self.subtree}: {name}" if self.subtree else name

    @property
    def why(self) -> str:
        """The reason why a control node did not handle the failure; "" for any other node."""
        return self.model.explain(self.failure) if self.model and self.failure.child else ""

    @property
    def attempt(self) -> tuple[int, int] | None:
        """Number of the failed attempt and of the allowed ones; None for a node that does not count."""
        return self.model.count_attempts(self.failure) if self.model else None


def chain(tree: Node, timeline: Timeline, origin: str, failure: str) -> tuple[Link, ...]:
    """Return the nodes that a failure passed, from the root to the one at the path `origin`.

    Args:
        tree: The mission's tree.
        timeline: Timeline of the run.
        origin: Path of the node in which it began.
        failure: Its name: `Grasp.missed`.
    """
    passed = way(tree, origin)
    source, _, reason = failure.rpartition(".")
    names = {source}
    links: list[Link] = []
    for index in reversed(range(len(passed))):
        node = passed[index]
        below = passed[index + 1] if index + 1 < len(passed) else None
        subtree = next((one.name for one in reversed(passed[:index]) if isinstance(one, UseNode)), "")
        model = inspection_instance(node) if isinstance(node, InnerNode) else None
        named = frozenset(Reason(name, reason) for name in names)
        links.append(Link(node, subtree, model, _passed(timeline, node, model, below, named)))
        names |= {node.label} if node.label else set()
    return tuple(reversed(links))


def _passed(
    timeline: Timeline, node: Node, model: ControlNode | None, below: Node | None, names: frozenset[Reason]
) -> PassedFailure:
    """Return the failure as a node saw it that came from the node `below`, None if it began there."""
    ran = timeline.nodes.get(node.path) or _NEVER
    children = [child for key in model.keys for child in model.children_of(key)] if model else []

    def has_failed(child: Child) -> bool:
        other = timeline.nodes.get(node_of(child).path)
        return other is not None and other.number > ran.number and other.status == "FAILURE"

    return PassedFailure(
        next((child for child in children if node_of(child) is below), None),
        ran.reason, names, ran.handled, ran.messages, ran.last_handled, ran.choice, ran.end - ran.start,
        has_failed,
    )  # fmt: skip


def way(tree: Node, path: str) -> list[Node]:
    """Return the nodes from the root down to the innermost one at a path; none where there is none."""
    return next(_ways(tree, path), [])


def _ways(node: Node, path: str) -> Iterator[list[Node]]:
    """Yield the way down to the innermost node at a path."""
    for child in node.children:
        for way in _ways(child, path):
            yield [node, *way]
    if node.path == path:
        yield [node]
