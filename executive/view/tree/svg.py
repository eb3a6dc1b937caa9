"""Drawing of a tree as one self-contained SVG, for pages and files.

Every node is a group of the class `node`. A page shows the state of a node by a second class, `running`,
`success` or `failure`, and raises its line above its siblings' by appending the group once more. The notes of
a page are the texts of the class `note`. The background is transparent.
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
"""Font sizes of a node's title and lines, of a slot and of a subtree's name, as in `tree.svg` [pixel]."""

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
        status: Status as in `status` events, or "" for a node that never ran.
        lines: Texts below those of the mission; a long line is cut.
    """

    status: str = ""
    lines: tuple[str, ...] = ()


def svg(nodes: Sequence[OutlineNode], name: str, notes: Mapping[str, Note] = MappingProxyType({})) -> str:
    """Return the drawing of a tree as an SVG document.

    Args:
        nodes: Outline of the tree.
        name: Name of the mission, for the title.
        notes: States of its nodes, by path; nodes without one get no note.
    """
    child_indices = children(nodes)
    parents = {child: parent for parent, indices in enumerate(child_indices) for child in indices}
    cards = [card(node) for node in nodes]
    said = [notes.get(node.path, Note()) for node in nodes]
    lines = [_list_lines(*each) for each in zip(cards, said, strict=True)]
    sizes = [_measure(*each) for each in zip(nodes, cards, lines, strict=True)]
    plan = layout([node.depth for node in nodes], child_indices, sizes)
    edges = [_draw_edge(plan, parents.get(index), index, node.depth) for index, node in enumerate(nodes)]
    ids, indents = map(identifier, (node.path for node in nodes)), map(_text_offset, cards)
    drawn = list(zip(nodes, cards, said, lines, plan.boxes, edges, ids, indents, strict=True))
    return render("tree/tree.svg", name=name, plan=plan, nodes=nodes, drawn=drawn)


def identifier(path: str) -> str:
    """Return the id of a node's group: its path, with `-` for `/` and `--hex-` for invalid characters."""
    return "node-" + _NOT_ID.sub(lambda found: f"--{ord(found[0]):x}-", path).replace("/", "-")


def _list_lines(shown: Card, note: Note) -> list[tuple[str, str]]:
    """Return the lines of a node with their classes; lines of the note are shortened."""
    notes = ("".join(fitted(line, COLUMNS)) for line in note.lines)
    return [*(("line", line) for line in shown.lines), *(("note", line) for line in notes)]


def _measure(node: OutlineNode, shown: Card, lines: Sequence[tuple[str, str]]) -> Size:
    text = max([extent(shown.title, TITLE, bold=True), *(extent(line, LINE) for _, line in lines)])
    slot = extent(node.slot, SLOT) + _AFTER_SLOT if node.slot else 0.0
    name = extent(node.subtree, NAME, bold=True) + FRAME if node.subtrees else 0.0
    return Size(_text_offset(shown) + text + _PADDING, _FIRST_LINE + _NEXT_LINE * len(lines), slot, name)


def _text_offset(shown: Card) -> float:
    """Return the distance of the text from the left side of the box [pixel]."""
    return _BADGE + 12 if shown.symbol else _PADDING


def _draw_edge(plan: Layout, parent: int | None, child: int, depth: int) -> str:
    """Return the path of the line from a node's parent; "" for the root."""
    if parent is None:
        return ""
    source, target, trunk = plan.boxes[parent], plan.boxes[child], plan.trunks[depth]
    path = f"M{source.right:.0f} {source.middle:.0f}"
    down = target.middle - source.middle
    if down >= 1:
        bend = min(_CORNER, down / 2)
        path += f"H{trunk - bend:.0f}q{bend:.0f} 0 {bend:.0f} {bend:.0f}"
        path += f"V{target.middle - bend:.0f}q0 {bend:.0f} {bend:.0f} {bend:.0f}"
    return f"{path}H{target.x:.0f}"
