"""The ways on that a mission takes only after a failure, or in the end, and which of them runs took."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from executive.mission.model import nodes
from executive.mission.model.nodes import Node
from executive.mission.source import Mark
from executive.view.figures.fault_trials import Branch, Trial


def branches(tree: Node, trials: Iterable[Trial]) -> tuple[Branch, ...]:
    """Return every such way in the order of the tree, and how many of the trials entered each.

    One that stands in a subtree which is used twice is one way with two nodes.
    """
    ran = [trial.entered for trial in trials]
    found: dict[tuple[str, int, int, str], list[str]] = {}
    for mark, what, node in _ways(tree):
        found.setdefault((mark.source.path, mark.line, mark.col, what), []).append(_path(node))
    return tuple(
        Branch(f"{file}:{line}", what, tuple(paths), sum(not entered.isdisjoint(paths) for entered in ran))
        for (file, line, _, what), paths in found.items()
    )


def _ways(tree: Node) -> Iterator[tuple[Mark, str, Node]]:
    for node in tree.walk():
        if isinstance(node, nodes.TryNode):
            for catch in node.catches:
                on = ", ".join(map(str, catch.on))
                yield catch.do.mark, f"catch on {on}", catch.do
            if node.finish is not None:
                yield node.finish.mark, "finally", node.finish
        elif isinstance(node, nodes.RetryNode) and node.recover is not None:
            yield node.recover.mark, "recover", node.recover
        elif isinstance(node, nodes.FallbackNode):
            for number, choice in enumerate(node.choices[1:], 2):
                yield choice.mark, f"choice {number}", choice


def _path(node: Node) -> str:
    """Return the path of the node that is built for one: a subtree without a label is what it consists of."""
    while isinstance(node, nodes.UseNode) and not node.label and node.body is not None:
        node = node.body
    return node.path
