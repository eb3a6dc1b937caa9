"""Drawing of a tree as an SVG document that needs no other files.

Each node is a group of the class `node`. To show the status of a node, a page adds the class `running`,
`success` or `failure` to its group. A page may also move the group to the end of the document, so that the
line to the node is drawn above other lines. The background is transparent; a page may be light or dark.

The nodes of one depth form a column. Each node has a horizontal band that contains its box and the bands of
its children, so that boxes cannot overlap. A frame encloses each subtree, within the band of the first node
of the subtree. A node and its first child are at the same height.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from executive.mission.outline import OutlineNode, list_child_indices
from executive.tree.node import ControlNode
from executive.view.text import (
    describe_connections,
    describe_reasons,
    estimate_text_width,
    render_template,
    wrap_and_truncate,
)

MAX_LINE_LENGTH = 28
"""Maximum length of a line of text in the box of a node [characters]."""
MARGIN = 16.0
"""Margin of the picture [pixel]."""
NODE_GAP = 10.0
"""Vertical distance between the boxes of nodes [pixel]."""
EDGE_SEGMENT_LENGTH = 16.0
"""Length of each horizontal part of the line between a node and its child [pixel]."""
FRAME_PADDING = 9.0
"""Distance between a frame and the boxes in the frame [pixel]."""
FRAME_HEADER = 20.0
"""Height of the part of a frame that contains the name of the subtree [pixel]."""

TITLE_SIZE = 13.0
LINE_SIZE = 11.0
SUBTREE_NAME_SIZE = 12.0
"""Font sizes of titles, of lines and labels of edges, and of names of subtrees; see `tree.svg` [pixel]."""
_INVALID_IN_ID = re.compile(r"[^A-Za-z0-9_/]")
"""Pattern of the characters of a path that are escaped in the id of an SVG element."""
_BOX_PADDING = 11.0
"""Distance between the texts and the sides of a box without a symbol [pixel]."""
_SYMBOL_WIDTH = 32.0
"""Width of a symbol with its margins [pixel]."""
_EDGE_LABEL_GAP = 4.0
"""Gap after the label of an edge [pixel]."""
_TITLE_HEIGHT = 28.0
_LINE_HEIGHT = 14.0
"""Heights of the title and of another line in the box of a node [pixel]."""
_MAX_CORNER_RADIUS = 6.0
"""Maximum radius of the rounded corners of an edge [pixel]."""

ChildIndices = Sequence[Sequence[int]]
"""Indices of the children of each node, by the index of the node."""


@dataclass(frozen=True)
class NodeResult:
    """Result of a node in a run, for the drawing of the node.

    Attributes:
        status: `RUNNING`, `SUCCESS`, `FAILURE` or `INVALID`; "" for a node that never ran.
        lines: Lines of text below the settings of the node; the drawing truncates long lines.
    """

    status: str = ""
    lines: tuple[str, ...] = ()


@dataclass(frozen=True)
class _NodeDrawing:
    """Texts in the box of a node.

    Attributes:
        node: The node.
        status: Status of the node in a run in lower case, or "".
        symbol: Symbol before the title of a control node; "" for a skill.
        title: Name of the node, truncated to `MAX_LINE_LENGTH`.
        lines: CSS class and text of each line below the title: settings of the node, and notes on its result.
        tooltip: All information about the node, with one line per topic.
        indent: Distance between the texts and the left side of the box [pixel].
    """

    node: OutlineNode
    status: str
    symbol: str
    title: str
    lines: Sequence[tuple[str, str]]
    tooltip: str
    indent: float

    @property
    def id(self) -> str:
        """Id of the group of the node in the document."""
        return make_group_id(self.node.path)


def make_svg(
    nodes: Sequence[OutlineNode], name: str, results: Mapping[str, NodeResult] = MappingProxyType({})
) -> str:
    """Return the drawing of a tree as an SVG document.

    `name` is the name of the mission, for the title; `results` contains results of nodes, by path.
    """
    child_indices = list_child_indices(nodes)
    parents = {child: parent for parent, children in enumerate(child_indices) for child in children}
    drawings = [_make_drawing(node, results.get(node.path, NodeResult())) for node in nodes]
    depths = [node.depth for node in nodes]
    layout = compute_layout(depths, child_indices, list(map(_compute_size, drawings)))
    edges = [_make_edge(layout, parents.get(index), index, depth) for index, depth in enumerate(depths)]
    return render_template("tree.svg", name=name, layout=layout, drawings=drawings, edges=edges)


def make_group_id(path: str) -> str:
    """Return the id of a node's group: its path with `-` for `/`, and `--<hex>-` for invalid characters."""
    return "node-" + _INVALID_IN_ID.sub(lambda match: f"--{ord(match[0]):x}-", path).replace("/", "-")


def _make_drawing(node: OutlineNode, result: NodeResult) -> _NodeDrawing:
    symbol = "" if node.kind == "skill" else node.symbol or ControlNode.symbol
    trigger_lines = wrap_and_truncate(node.trigger, MAX_LINE_LENGTH, 2)
    detail_lines = wrap_and_truncate(node.detail, MAX_LINE_LENGTH, 3 if symbol else 2)
    lines = [("line", line) for line in trigger_lines + detail_lines]
    lines += [("note", _truncate(line)) for line in result.lines]
    indent = _SYMBOL_WIDTH if symbol else _BOX_PADDING
    tooltip = "\n".join(filter(None, (*_list_tooltip_lines(node), *result.lines)))
    return _NodeDrawing(node, result.status.lower(), symbol, _truncate(node.title), lines, tooltip, indent)


def _list_tooltip_lines(node: OutlineNode) -> Sequence[str]:
    """Return all information about a node; the most important line is the first."""
    type_name = node.skill or node.kind
    return (
        node.title if node.title == type_name else f"{node.title}: {type_name}",
        node.doc,
        node.trigger,
        node.detail,
        *describe_connections(node),
        describe_reasons(node),
        f"subtree {node.joined_subtrees}" if node.subtrees else "",
        node.path,
    )


def _truncate(text: str) -> str:
    return "".join(wrap_and_truncate(text, MAX_LINE_LENGTH))


def _compute_size(drawing: _NodeDrawing) -> NodeSize:
    """Return the sizes of the box of a node, of the label of its edge, and of the name of its subtree."""
    widths = [estimate_text_width(line, LINE_SIZE) for _, line in drawing.lines]
    widths.append(estimate_text_width(drawing.title, TITLE_SIZE, bold=True))
    height = _TITLE_HEIGHT + _LINE_HEIGHT * len(drawing.lines)
    label = drawing.node.parent_key
    name = drawing.node.joined_subtrees
    label_width = estimate_text_width(label, LINE_SIZE) + _EDGE_LABEL_GAP if label else 0.0
    name_width = estimate_text_width(name, SUBTREE_NAME_SIZE, bold=True) + FRAME_PADDING if name else 0.0
    return NodeSize(drawing.indent + max(widths) + _BOX_PADDING, height, label_width, name_width)


def _make_edge(layout: Layout, parent: int | None, child: int, depth: int) -> str:
    """Return the SVG path of the line between the nodes `parent` and `child`; "" for no parent.

    The line runs to the right (command H), around a corner (q) down (V), and around a corner to the right.
    """
    if parent is None:
        return ""
    start = layout.boxes[parent]
    end = layout.boxes[child]
    edge_x = layout.edge_xs[depth]
    path = f"M{start.right_x:.0f} {start.middle_y:.0f}"
    height = end.middle_y - start.middle_y
    if height >= 1:
        radius = min(_MAX_CORNER_RADIUS, height / 2)
        path += f"H{edge_x - radius:.0f}q{radius:.0f} 0 {radius:.0f} {radius:.0f}"
        path += f"V{end.middle_y - radius:.0f}q0 {radius:.0f} {radius:.0f} {radius:.0f}"
    return f"{path}H{end.x:.0f}"


@dataclass(frozen=True)
class NodeSize:
    """Sizes of the parts of a node [pixel].

    Attributes:
        width, height: Size of the box.
        label_width: Width of the label of the line to the node; 0 for no label.
        subtree_name_width: Width of the name of the subtree that starts at the node; 0 if none starts there.
    """

    width: float
    height: float
    label_width: float = 0.0
    subtree_name_width: float = 0.0


@dataclass(frozen=True)
class Rectangle:
    """Rectangle in the picture [pixel]; `x` and `y` are its top left corner, and y points down."""

    x: float
    y: float
    width: float
    height: float

    @property
    def right_x(self) -> float:
        """The x of the right side [pixel]."""
        return self.x + self.width

    @property
    def middle_y(self) -> float:
        """The y of the middle [pixel]."""
        return self.y + self.height / 2


@dataclass(frozen=True)
class Layout:
    """Layout of a picture of a tree [pixel].

    Attributes:
        boxes: Box of each node.
        edge_xs: The x of the vertical parts of the lines to the nodes of each depth.
        frames: Frame of each subtree, by the index of the first node of the subtree.
        width, height: Size of the picture with margins.
    """

    boxes: tuple[Rectangle, ...]
    edge_xs: tuple[float, ...]
    frames: dict[int, Rectangle]
    width: float
    height: float


def compute_layout(depths: Sequence[int], children: ChildIndices, sizes: Sequence[NodeSize]) -> Layout:
    """Return the layout of a tree; its nodes are listed with parents before their children.

    Args:
        depths: Depth of each node; 0 for the root.
        children: Indices of the children of each node.
        sizes: Sizes of the parts of each node.
    """
    column_xs, edge_xs = _place_columns(depths, sizes)
    band_heights, node_offsets = _compute_bands(children, sizes)
    band_tops = _place_bands(children, band_heights, node_offsets)
    boxes = tuple(
        Rectangle(column_xs[depth], top + offset - size.height / 2, size.width, size.height)
        for depth, top, offset, size in zip(depths, band_tops, node_offsets, sizes, strict=True)
    )
    right_xs = _find_branch_ends(children, sizes, boxes)
    frames = {}
    for index, box in enumerate(boxes):
        if sizes[index].subtree_name_width:
            y = band_tops[index] + NODE_GAP / 2
            width = right_xs[index] - box.x + FRAME_PADDING
            frames[index] = Rectangle(box.x - FRAME_PADDING, y, width, band_heights[index] - NODE_GAP)
    height = band_tops[0] + band_heights[0] + MARGIN - NODE_GAP / 2
    return Layout(boxes, edge_xs, frames, max(right_xs) + MARGIN, height)


def _place_columns(depths: Sequence[int], sizes: Sequence[NodeSize]) -> tuple[list[float], tuple[float, ...]]:
    """Return the x of each column, and the x of the vertical parts of the lines before each column."""
    column_xs: list[float] = []
    edge_xs: list[float] = []
    right_x = 0.0
    for depth in range(max(depths) + 1):
        column = [size for size, node_depth in zip(sizes, depths, strict=True) if node_depth == depth]
        padding = FRAME_PADDING if any(size.subtree_name_width for size in column) else 0.0
        edge_xs.append(right_x + EDGE_SEGMENT_LENGTH if depth else MARGIN)
        edge_length = EDGE_SEGMENT_LENGTH + max(size.label_width for size in column) if depth else 0.0
        column_xs.append(edge_xs[-1] + edge_length + padding)
        right_x = column_xs[-1] + max(size.width for size in column)
    return column_xs, tuple(edge_xs)


def _compute_bands(children: ChildIndices, sizes: Sequence[NodeSize]) -> tuple[list[float], list[float]]:
    """Return by node the height of its band, and the distance from the top of the band to the box middle.

    Children follow their parents in the lists, so the bands are computed from the last node to the first.
    """
    band_heights = [0.0] * len(sizes)
    node_offsets = [0.0] * len(sizes)
    for index in reversed(range(len(sizes))):
        size = sizes[index]
        node_children = children[index]
        top_padding, bottom_padding = (FRAME_HEADER, FRAME_PADDING) if size.subtree_name_width else (0.0, 0.0)
        half_height = (size.height + NODE_GAP) / 2
        first_child_offset = node_offsets[node_children[0]] if node_children else 0.0
        node_offsets[index] = top_padding + max(half_height, first_child_offset)
        children_top = node_offsets[index] - first_child_offset
        children_bottom = children_top + sum(band_heights[child] for child in node_children)
        band_heights[index] = max(node_offsets[index] + half_height, children_bottom) + bottom_padding
    return band_heights, node_offsets


def _place_bands(children: ChildIndices, band_heights: list[float], node_offsets: list[float]) -> list[float]:
    """Return the y of the top of each band, given the results of `_compute_bands`."""
    band_tops = [MARGIN - NODE_GAP / 2] * len(band_heights)
    for index, node_children in enumerate(children):
        first_child_offset = node_offsets[node_children[0]] if node_children else 0.0
        top = band_tops[index] + node_offsets[index] - first_child_offset
        for child in node_children:
            band_tops[child] = top
            top += band_heights[child]
    return band_tops


def _find_branch_ends(
    children: ChildIndices, sizes: Sequence[NodeSize], boxes: Sequence[Rectangle]
) -> list[float]:
    """Return the x of the right end of each node with its descendants and their frames."""
    right_xs = [0.0] * len(sizes)
    for index in reversed(range(len(sizes))):
        box = boxes[index]
        name_width = sizes[index].subtree_name_width
        right_x = max([box.right_x, *(right_xs[child] for child in children[index])])
        right_xs[index] = max(right_x + FRAME_PADDING, box.x + name_width) if name_width else right_x
    return right_xs
