"""Drawing of a tree as an SVG document that needs no other files.

Each node is a group of the class `node`. To show the status of a node, a page adds the class `running`,
`success` or `failure` to its group. A page may also move the group to the end of the document, so that the
line to the node is drawn above other lines. The background is transparent; a page may be light or dark.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from executive.mission.outline import OutlineNode, list_child_indices
from executive.view.text import estimate_text_width, render_template, wrap_and_truncate
from executive.view.tree.node_texts import MAX_LINE_LENGTH, NodeTexts, make_node_texts
from executive.view.tree.tree_layout import FRAME_PADDING, Layout, NodeSize, compute_layout

TITLE_SIZE, LINE_SIZE, EDGE_LABEL_SIZE, SUBTREE_NAME_SIZE = 13.0, 11.0, 11.0, 12.0
"""Font sizes of titles, lines, labels of edges and names of subtrees; `tree.svg` repeats them [pixel]."""

_INVALID_IN_ID = re.compile(r"[^A-Za-z0-9_/]")
"""Pattern of the characters of a path that are escaped in the id of an SVG element."""
_BOX_PADDING, _SYMBOL_WIDTH, _EDGE_LABEL_GAP = 11.0, 32.0, 4.0
"""Padding of a box, width of a symbol with margins, and gap after the label of an edge [pixel]."""
_TITLE_HEIGHT, _LINE_HEIGHT = 28.0, 14.0
"""Heights of the title and of another line in the box of a node [pixel]."""
_MAX_CORNER_RADIUS = 6.0
"""Maximum radius of the rounded corners of an edge [pixel]."""


@dataclass(frozen=True)
class NodeResult:
    """Result of a node in a run, for the drawing of the node.

    Attributes:
        status: `RUNNING`, `SUCCESS`, `FAILURE` or `INVALID`; "" for a node that never ran.
        lines: Lines of text below the settings of the node; the drawing truncates long lines.
    """

    status: str = ""
    lines: tuple[str, ...] = ()


NO_RESULTS: Mapping[str, NodeResult] = MappingProxyType({})
"""Results of the nodes of a mission that did not run."""


def make_svg(nodes: Sequence[OutlineNode], name: str, results: Mapping[str, NodeResult] = NO_RESULTS) -> str:
    """Return the drawing of a tree as an SVG document.

    `name` is the name of the mission, for the title; `results` contains results of nodes, by path.
    """
    child_indices = list_child_indices(nodes)
    parents = {child: parent for parent, children in enumerate(child_indices) for child in children}
    texts = [make_node_texts(node) for node in nodes]
    node_results = [results.get(node.path, NodeResult()) for node in nodes]
    lines = list(map(_list_lines, texts, node_results))
    sizes = list(map(_compute_size, nodes, texts, lines))
    layout = compute_layout([node.depth for node in nodes], child_indices, sizes)
    edges = [_make_edge(layout, parents.get(index), index, node.depth) for index, node in enumerate(nodes)]
    ids, indents = [make_group_id(node.path) for node in nodes], map(_compute_text_indent, texts)
    drawings = list(zip(nodes, texts, node_results, lines, layout.boxes, edges, ids, indents, strict=True))
    return render_template("tree/tree.svg", name=name, layout=layout, nodes=nodes, drawings=drawings)


def make_group_id(path: str) -> str:
    """Return the id of a node's group: its path with `-` for `/`, and `--<hex>-` for invalid characters."""
    return "node-" + _INVALID_IN_ID.sub(lambda match: f"--{ord(match[0]):x}-", path).replace("/", "-")


def _list_lines(texts: NodeTexts, result: NodeResult) -> list[tuple[str, str]]:
    """Return the CSS class and the text of each line of a node below its title."""
    notes = ("".join(wrap_and_truncate(line, MAX_LINE_LENGTH)) for line in result.lines)
    return [*(("line", line) for line in texts.lines), *(("note", note) for note in notes)]


def _compute_size(node: OutlineNode, texts: NodeTexts, lines: Sequence[tuple[str, str]]) -> NodeSize:
    """Return the sizes of the box of a node, of the label of its edge, and of the name of its subtree."""
    widths = [estimate_text_width(line, LINE_SIZE) for _, line in lines]
    text_width = max([estimate_text_width(texts.title, TITLE_SIZE, bold=True), *widths])
    width = _compute_text_indent(texts) + text_width + _BOX_PADDING
    height = _TITLE_HEIGHT + _LINE_HEIGHT * len(lines)
    label, name = node.parent_key, node.joined_subtrees
    label_width = estimate_text_width(label, EDGE_LABEL_SIZE) + _EDGE_LABEL_GAP if label else 0.0
    name_width = estimate_text_width(name, SUBTREE_NAME_SIZE, bold=True) + FRAME_PADDING if name else 0.0
    return NodeSize(width, height, label_width, name_width)


def _compute_text_indent(texts: NodeTexts) -> float:
    """Return the distance between the text of a node and the left side of its box [pixel]."""
    return _SYMBOL_WIDTH if texts.symbol else _BOX_PADDING


def _make_edge(layout: Layout, parent: int | None, child: int, depth: int) -> str:
    """Return the SVG path of the line between the nodes `parent` and `child`; "" for no parent.

    The line runs to the right (command H), around a corner (q) down (V), and around a corner to the right.
    """
    if parent is None:
        return ""
    start, end, edge_x = layout.boxes[parent], layout.boxes[child], layout.edge_xs[depth]
    path = f"M{start.right_x:.0f} {start.middle_y:.0f}"
    height = end.middle_y - start.middle_y
    if height >= 1:
        radius = min(_MAX_CORNER_RADIUS, height / 2)
        path += f"H{edge_x - radius:.0f}q{radius:.0f} 0 {radius:.0f} {radius:.0f}"
        path += f"V{end.middle_y - radius:.0f}q0 {radius:.0f} {radius:.0f} {radius:.0f}"
    return f"{path}H{end.x:.0f}"
