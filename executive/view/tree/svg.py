"""Picture of a tree: one SVG that needs nothing else, for a page as for a file.

Every node is a group with the class `node`; a page shows its state by giving it one more, `running`,
`success` or `failure`, and raises its line above its siblings' by appending the group once more. The notes of
a page are the texts of the class `note`. The ground behind the picture, light or dark, shines through.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from executive.mission.outline import OutlineNode, children
from executive.view.text import extent, fitted, render
from executive.view.tree.card import COLUMNS, Card, card
from executive.view.tree.layout import FRAME, Layout, Size, layout

TITLE, LINE, SLOT, NAME = 13.0, 11.0, 11.0, 12.0
"""Sizes of a node's title and lines, of a slot and of a subtree's name, as in `tree.svg` [pixel]."""

_NOT_ID = re.compile(r"[^A-Za-z0-9_/]")
_PADDING = 11.0
_BADGE = 20.0
_FIRST_LINE = 28.0
_NEXT_LINE = 14.0
_CORNER = 6.0
_AFTER_SLOT = 4.0


@dataclass(frozen=True)
class Note:
    """State of a node in a run.

    Attributes:
        status: As `status` events have it, or "" for a node that never ran.
        lines: Texts below what the mission says; a line that is too long is cut.
    """

    status: str = ""
    lines: tuple[str, ...] = ()


def svg(nodes: Sequence[OutlineNode], name: str, notes: Mapping[str, Note] = MappingProxyType({})) -> str:
    """Return the picture of a tree as an SVG document.

    Args:
        nodes: Its outline.
        name: The mission's, for the title.
        notes: States of its nodes, by path; nodes without one get no note.
    """
    below = children(nodes)
    parents = {child: parent for parent, among in enumerate(below) for child in among}
    cards = [card(node) for node in nodes]
    said = [notes.get(node.path, Note()) for node in nodes]
    lines = [_lines(*each) for each in zip(cards, said, strict=True)]
    sizes = [_size(*each) for each in zip(nodes, cards, lines, strict=True)]
    plan = layout([node.depth for node in nodes], below, sizes)
    edges = [_edge(plan, parents.get(index), index, node.depth) for index, node in enumerate(nodes)]
    ids, indents = map(identifier, (node.path for node in nodes)), map(_indent, cards)
    drawn = list(zip(nodes, cards, said, lines, plan.boxes, edges, ids, indents, strict=True))
    return render("tree/tree.svg", name=name, plan=plan, nodes=nodes, drawn=drawn)


def identifier(path: str) -> str:
    """Return the id of a node's group: its path, with `-` for `/` and `--hex-` for what an id cannot hold."""
    return "node-" + _NOT_ID.sub(lambda found: f"--{ord(found[0]):x}-", path).replace("/", "-")


def _lines(shown: Card, note: Note) -> list[tuple[str, str]]:
    """Return the lines of a node, each with its class; a line of a note is short enough for a node."""
    notes = ("".join(fitted(line, COLUMNS)) for line in note.lines)
    return [*(("line", line) for line in shown.lines), *(("note", line) for line in notes)]


def _size(node: OutlineNode, shown: Card, lines: Sequence[tuple[str, str]]) -> Size:
    text = max([extent(shown.title, TITLE, bold=True), *(extent(line, LINE) for _, line in lines)])
    slot = extent(node.slot, SLOT) + _AFTER_SLOT if node.slot else 0.0
    name = extent(node.subtree, NAME, bold=True) + FRAME if node.subtrees else 0.0
    return Size(_indent(shown) + text + _PADDING, _FIRST_LINE + _NEXT_LINE * len(lines), slot, name)


def _indent(shown: Card) -> float:
    """Return how far the text of a node stands from the left side of its box."""
    return _BADGE + 12 if shown.symbol else _PADDING


def _edge(plan: Layout, parent: int | None, child: int, depth: int) -> str:
    """Return the way of the line from a node's parent; "" for the root."""
    if parent is None:
        return ""
    source, target, trunk = plan.boxes[parent], plan.boxes[child], plan.trunks[depth]
    way = f"M{source.right:.0f} {source.middle:.0f}"
    down = target.middle - source.middle
    if down >= 1:
        bend = min(_CORNER, down / 2)
        way += f"H{trunk - bend:.0f}q{bend:.0f} 0 {bend:.0f} {bend:.0f}"
        way += f"V{target.middle - bend:.0f}q0 {bend:.0f} {bend:.0f} {bend:.0f}"
    return f"{way}H{target.x:.0f}"
