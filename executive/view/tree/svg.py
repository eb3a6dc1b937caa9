"""Picture of a tree: an SVG document without other files, for pages and files.

Each node is a group of the class `node`. A page shows the status of a node by the further class `running`,
`success` or `failure`, and draws the line of a node above others by appending its group again. Notes are
texts of the class `note`. The background is transparent, and may be light or dark.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from executive.mission.outline import OutlineNode, children
from executive.view.text import fit_text, measure_text, render
from executive.view.tree.card import COLUMNS, Card, make_card
from executive.view.tree.layout import FRAME, Layout, Size, compute_layout

TITLE_SIZE, LINE_SIZE, SLOT_SIZE, NAME_SIZE = 13.0, 11.0, 11.0, 12.0
"""Font sizes of title, lines, slot and subtree name, as in `tree.svg` [pixel]."""

_INVALID_IN_ID = re.compile(r"[^A-Za-z0-9_/]")
_PADDING, _BADGE_SIZE, _SLOT_GAP, _CORNER_RADIUS = 11.0, 20.0, 4.0, 6.0
_TITLE_HEIGHT, _LINE_HEIGHT = 28.0, 14.0


@dataclass(frozen=True)
class Note:
    """State of a node in a run.

    Attributes:
        status: Status as in events, or "" for a node that never ran.
        lines: Lines below those of the mission; a long line is shortened.
    """

    status: str = ""
    lines: tuple[str, ...] = ()


NO_NOTES: Mapping[str, Note] = MappingProxyType({})


def draw_svg(nodes: Sequence[OutlineNode], name: str, notes: Mapping[str, Note] = NO_NOTES) -> str:
    """Return the picture of a tree as an SVG document.

    Args:
        nodes: Outline of the tree.
        name: Name of the mission, for the title.
        notes: Notes by path of the node.
    """
    child_lists = children(nodes)
    parents = {child: parent for parent, child_list in enumerate(child_lists) for child in child_list}
    cards = [make_card(node) for node in nodes]
    node_notes = [notes.get(node.path, Note()) for node in nodes]
    lines = [_collect_lines(*each) for each in zip(cards, node_notes, strict=True)]
    sizes = [_compute_size(*each) for each in zip(nodes, cards, lines, strict=True)]
    layout = compute_layout([node.depth for node in nodes], child_lists, sizes)
    edges = [_draw_edge(layout, parents.get(index), index, node.depth) for index, node in enumerate(nodes)]
    ids, indents = map(make_id, (node.path for node in nodes)), map(_compute_indent, cards)
    drawn = list(zip(nodes, cards, node_notes, lines, layout.boxes, edges, ids, indents, strict=True))
    return render("tree/tree.svg", name=name, layout=layout, nodes=nodes, drawn=drawn)


def make_id(path: str) -> str:
    """Return the id of the group of a node: its path, with `-` for `/` and `--hex-` for others."""
    return "node-" + _INVALID_IN_ID.sub(lambda match: f"--{ord(match[0]):x}-", path).replace("/", "-")


def _collect_lines(shown: Card, note: Note) -> list[tuple[str, str]]:
    """Return class and text of each line of a node; lines of a note are shortened."""
    notes = ("".join(fit_text(line, COLUMNS)) for line in note.lines)
    return [*(("line", line) for line in shown.lines), *(("note", line) for line in notes)]


def _compute_size(node: OutlineNode, shown: Card, lines: Sequence[tuple[str, str]]) -> Size:
    lengths = [measure_text(shown.title, TITLE_SIZE, bold=True)]
    lengths += [measure_text(line, LINE_SIZE) for _, line in lines]
    width, height = (
        _compute_indent(shown) + max(lengths) + _PADDING,
        _TITLE_HEIGHT + _LINE_HEIGHT * len(lines),
    )
    slot = measure_text(node.slot, SLOT_SIZE) + _SLOT_GAP if node.slot else 0.0
    name = measure_text(node.subtree, NAME_SIZE, bold=True) + FRAME if node.subtrees else 0.0
    return Size(width, height, slot, name)


def _compute_indent(shown: Card) -> float:
    """Return the distance of the text of a node from the left side of its box."""
    return _BADGE_SIZE + 12 if shown.symbol else _PADDING


def _draw_edge(layout: Layout, parent: int | None, child: int, depth: int) -> str:
    """Return the SVG path of the line from the parent of a node; "" for the root."""
    if parent is None:
        return ""
    source, target, trunk = layout.boxes[parent], layout.boxes[child], layout.trunks[depth]
    path = f"M{source.right:.0f} {source.middle:.0f}"
    down = target.middle - source.middle
    if down >= 1:
        bend = min(_CORNER_RADIUS, down / 2)
        path += f"H{trunk - bend:.0f}q{bend:.0f} 0 {bend:.0f} {bend:.0f}"
        path += f"V{target.middle - bend:.0f}q0 {bend:.0f} {bend:.0f} {bend:.0f}"
    return f"{path}H{target.x:.0f}"
