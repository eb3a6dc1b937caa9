"""Drawing of a tree as an SVG document that needs no other files.

Each node is a group of the class `node`. A page shows the status of a node by adding the class `running`,
`success` or `failure` to the group, and moves the group to the end to draw its line above others. Notes are
texts of the class `note`. The background is transparent, and may be light or dark.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from executive.mission.outline import OutlineNode, list_child_indices
from executive.view.text import fit_text, measure_text, render_template
from executive.view.tree.card import MAX_LINE_LENGTH, Card, make_card
from executive.view.tree.tree_layout import FRAME_PADDING, Layout, NodeSize, compute_layout

TITLE_SIZE, LINE_SIZE, EDGE_LABEL_SIZE, SUBTREE_NAME_SIZE = 13.0, 11.0, 11.0, 12.0
"""Font sizes of titles, lines, labels of edges and names of subtrees, as in `tree.svg` [pixel]."""

_INVALID_IN_ID = re.compile(r"[^A-Za-z0-9_/]")
_PADDING, _BADGE_SIZE, _EDGE_LABEL_GAP, _CORNER_RADIUS = 11.0, 20.0, 4.0, 6.0
_TITLE_HEIGHT, _LINE_HEIGHT = 28.0, 14.0


@dataclass(frozen=True)
class NodeNote:
    """Result of a node in a run, for the drawing of the node.

    Attributes:
        status: Status of the node as in events, such as `SUCCESS`; "" for a node that never ran.
        lines: Lines of text below the lines from the mission; a long line is truncated.
    """

    status: str = ""
    lines: tuple[str, ...] = ()


NO_NODE_NOTES: Mapping[str, NodeNote] = MappingProxyType({})


def draw_svg(nodes: Sequence[OutlineNode], name: str, notes: Mapping[str, NodeNote] = NO_NODE_NOTES) -> str:
    """Return the drawing of a tree as an SVG document.

    Args:
        nodes: Nodes of the tree.
        name: Name of the mission, for the title.
        notes: Results of nodes, by path of the node.
    """
    child_lists = list_child_indices(nodes)
    parents = {child: parent for parent, child_list in enumerate(child_lists) for child in child_list}
    cards = [make_card(node) for node in nodes]
    node_notes = [notes.get(node.path, NodeNote()) for node in nodes]
    lines = [_list_lines(*parts) for parts in zip(cards, node_notes, strict=True)]
    sizes = [_compute_size(*parts) for parts in zip(nodes, cards, lines, strict=True)]
    layout = compute_layout([node.depth for node in nodes], child_lists, sizes)
    edges = [_draw_edge(layout, parents.get(index), index, node.depth) for index, node in enumerate(nodes)]
    ids, indents = map(make_group_id, (node.path for node in nodes)), map(_compute_indent, cards)
    drawings = list(zip(nodes, cards, node_notes, lines, layout.boxes, edges, ids, indents, strict=True))
    return render_template("tree/tree.svg", name=name, layout=layout, nodes=nodes, drawings=drawings)


def make_group_id(path: str) -> str:
    """Return the id of the group of a node: its path with `-` for `/` and `--hex-` for other characters."""
    return "node-" + _INVALID_IN_ID.sub(lambda match: f"--{ord(match[0]):x}-", path).replace("/", "-")


def _list_lines(card: Card, note: NodeNote) -> list[tuple[str, str]]:
    """Return the CSS class and the text of each line of a node; the lines of the note are truncated."""
    notes = ("".join(fit_text(line, MAX_LINE_LENGTH)) for line in note.lines)
    return [*(("line", line) for line in card.lines), *(("note", line) for line in notes)]


def _compute_size(node: OutlineNode, card: Card, lines: Sequence[tuple[str, str]]) -> NodeSize:
    lengths = [measure_text(card.title, TITLE_SIZE, bold=True)]
    lengths += [measure_text(line, LINE_SIZE) for _, line in lines]
    width, height = (
        _compute_indent(card) + max(lengths) + _PADDING,
        _TITLE_HEIGHT + _LINE_HEIGHT * len(lines),
    )
    label_width = measure_text(node.slot, EDGE_LABEL_SIZE) + _EDGE_LABEL_GAP if node.slot else 0.0
    subtree_name_width = measure_text(node.subtree, SUBTREE_NAME_SIZE, bold=True) + FRAME_PADDING
    return NodeSize(width, height, label_width, subtree_name_width if node.subtrees else 0.0)


def _compute_indent(card: Card) -> float:
    """Return the distance between the text of a node and the left side of its box [pixel]."""
    return _BADGE_SIZE + 12 if card.symbol else _PADDING


def _draw_edge(layout: Layout, parent: int | None, child: int, depth: int) -> str:
    """Return the SVG path of the line between the nodes `parent` and `child`; "" for no parent."""
    if parent is None:
        return ""
    source, target, edge_x = layout.boxes[parent], layout.boxes[child], layout.edge_xs[depth]
    path = f"M{source.right:.0f} {source.middle:.0f}"
    height = target.middle - source.middle
    if height >= 1:
        radius = min(_CORNER_RADIUS, height / 2)
        path += f"H{edge_x - radius:.0f}q{radius:.0f} 0 {radius:.0f} {radius:.0f}"
        path += f"V{target.middle - radius:.0f}q0 {radius:.0f} {radius:.0f} {radius:.0f}"
    return f"{path}H{target.x:.0f}"
