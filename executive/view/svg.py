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


@dataclass(frozen=True)
class NodeResult:
    """Result of a node in a run, for the drawing of the node.

    Attributes:
        status: `RUNNING`, `SUCCESS`, `FAILURE` or `INVALID`; "" for a node that never ran.
        lines: Lines of text below the settings of the node; the drawing truncates long lines.
    """

    status: str = ""
    lines: tuple[str, ...] = ()


@dataclass(eq=False)
class NodeBox:
    """Box of a node in the picture [pixel]; y points down.

    Attributes:
        depth: Depth of the node; 0 for the root.
        width, height: Size of the box.
        label_width: Width of the label of the line to the node; 0 for no label.
        subtree_name_width: Width of the name of the subtree that starts at the node; 0 if none starts there.
        children: Boxes of the children.
        x: The x of the left side.
        edge_x: The x of the vertical part of the line to the node.
        right_end: The x of the right end of the node with its descendants and their frames.
        band_top, band_height: The y of the top of the band, and its height.
        middle_offset: Distance from the top of the band to the middle of the box.
        edge: SVG path of the line from the parent; "" for the root.
    """

    depth: int
    width: float
    height: float
    label_width: float = 0.0
    subtree_name_width: float = 0.0
    children: Sequence[NodeBox] = ()
    x: float = 0.0
    edge_x: float = 0.0
    right_end: float = 0.0
    band_top: float = 0.0
    band_height: float = 0.0
    middle_offset: float = 0.0
    edge: str = ""

    @property
    def middle_y(self) -> float:
        """The y of the middle of the box."""
        return self.band_top + self.middle_offset

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Left side, top, width and height of the box."""
        return self.x, self.middle_y - self.height / 2, self.width, self.height

    @property
    def frame(self) -> tuple[float, float, float, float]:
        """Left side, top, width and height of the frame of the subtree that starts at the node."""
        width = self.right_end - self.x + FRAME_PADDING
        return self.x - FRAME_PADDING, self.band_top + NODE_GAP / 2, width, self.band_height - NODE_GAP


@dataclass(frozen=True)
class _NodeDrawing:
    """Box of a node, and the texts in the box.

    Attributes:
        node: The node.
        status: Status of the node in a run in lower case, or "".
        symbol: Symbol before the title of a control node; "" for a skill.
        title: Name of the node, truncated to `MAX_LINE_LENGTH`.
        lines: CSS class and text of each line below the title: settings of the node, and notes on its result.
        tooltip: All information about the node, with one line per topic.
        indent: Distance between the texts and the left side of the box [pixel].
        box: Box of the node.
    """

    node: OutlineNode
    status: str
    symbol: str
    title: str
    lines: Sequence[tuple[str, str]]
    tooltip: str
    indent: float
    box: NodeBox


def make_svg(
    nodes: Sequence[OutlineNode], name: str, results: Mapping[str, NodeResult] = MappingProxyType({})
) -> str:
    """Return the drawing of a tree as an SVG document.

    `name` is the name of the mission, for the title; `results` contains results of nodes, by path.
    """
    drawings = [_make_drawing(node, results.get(node.path, NodeResult())) for node in nodes]
    boxes = [drawing.box for drawing in drawings]
    for box, indices in zip(boxes, list_child_indices(nodes), strict=True):
        box.children = [boxes[index] for index in indices]
    width, height = place_boxes(boxes)
    return render_template(
        "tree.svg", name=name, width=width, height=height, drawings=drawings, make_group_id=make_group_id
    )


def _make_drawing(node: OutlineNode, result: NodeResult) -> _NodeDrawing:
    symbol = "" if node.kind == "skill" else node.symbol or ControlNode.symbol
    title = _truncate(node.title)
    trigger_lines = wrap_and_truncate(node.trigger, MAX_LINE_LENGTH, 2)
    detail_lines = wrap_and_truncate(node.detail, MAX_LINE_LENGTH, 3 if symbol else 2)
    lines = [("line", line) for line in trigger_lines + detail_lines]
    lines += [("note", _truncate(line)) for line in result.lines]
    tooltip = "\n".join(filter(None, (*_list_tooltip_lines(node), *result.lines)))
    indent = _SYMBOL_WIDTH if symbol else _BOX_PADDING
    widths = [estimate_text_width(line, LINE_SIZE) for _, line in lines]
    widths.append(estimate_text_width(title, TITLE_SIZE, bold=True))
    label = node.parent_key
    subtree = node.joined_subtrees
    box = NodeBox(
        depth=node.depth,
        width=indent + max(widths) + _BOX_PADDING,
        height=_TITLE_HEIGHT + _LINE_HEIGHT * len(lines),
        label_width=estimate_text_width(label, LINE_SIZE) + _EDGE_LABEL_GAP if label else 0.0,
        subtree_name_width=(
            estimate_text_width(subtree, SUBTREE_NAME_SIZE, bold=True) + FRAME_PADDING if subtree else 0.0
        ),
    )
    return _NodeDrawing(node, result.status.lower(), symbol, title, lines, tooltip, indent, box)


def make_group_id(path: str) -> str:
    """Return the id of a node's group: its path with `-` for `/`, and `--<hex>-` for invalid characters."""
    return "node-" + _INVALID_IN_ID.sub(lambda match: f"--{ord(match[0]):x}-", path).replace("/", "-")


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


def place_boxes(boxes: Sequence[NodeBox]) -> tuple[float, float]:
    """Set the positions of the boxes of a tree, parents before their children; return width and height."""
    _place_columns(boxes)
    for box in reversed(boxes):
        _measure_branch(box)
    root = boxes[0]
    root.band_top = MARGIN - NODE_GAP / 2
    for box in boxes:
        band_top = box.middle_y - _get_first_offset(box)
        for child in box.children:
            child.band_top = band_top
            child.edge = _draw_edge(box, child)
            band_top += child.band_height
    return root.right_end + MARGIN, root.band_top + root.band_height + MARGIN - NODE_GAP / 2


def _place_columns(boxes: Sequence[NodeBox]) -> None:
    """Set the x of each box, and of the vertical part of the line to the box."""
    right_x = 0.0
    for depth in range(max(box.depth for box in boxes) + 1):
        column = [box for box in boxes if box.depth == depth]
        edge_x = right_x + EDGE_SEGMENT_LENGTH if depth else MARGIN
        edge_length = EDGE_SEGMENT_LENGTH + max(box.label_width for box in column) if depth else 0.0
        padding = FRAME_PADDING if any(box.subtree_name_width for box in column) else 0.0
        for box in column:
            box.edge_x = edge_x
            box.x = edge_x + edge_length + padding
        right_x = column[0].x + max(box.width for box in column)


def _measure_branch(box: NodeBox) -> None:
    """Set the right end and the band of a box whose children have been measured."""
    first_offset = _get_first_offset(box)
    half_height = (box.height + NODE_GAP) / 2
    children_height = sum(child.band_height for child in box.children)
    box.middle_offset = max(half_height, first_offset)
    box.band_height = box.middle_offset + max(half_height, children_height - first_offset)
    box.right_end = max([box.x + box.width, *(child.right_end for child in box.children)])
    if box.subtree_name_width:
        box.middle_offset += FRAME_HEADER
        box.band_height += FRAME_HEADER + FRAME_PADDING
        box.right_end = max(box.right_end + FRAME_PADDING, box.x + box.subtree_name_width)


def _get_first_offset(box: NodeBox) -> float:
    """Return the middle offset of the first child, whose middle has the same y as the middle of `box`."""
    return box.children[0].middle_offset if box.children else 0.0


def _draw_edge(parent: NodeBox, child: NodeBox) -> str:
    """Return the SVG path of the line between two boxes.

    The line runs to the right (command H), around a corner (q) down (V), and around a corner to the right.
    """
    path = f"M{parent.x + parent.width:.0f} {parent.middle_y:.0f}"
    height = child.middle_y - parent.middle_y
    if height >= 1:
        radius = min(_MAX_CORNER_RADIUS, height / 2)
        path += f"H{child.edge_x - radius:.0f}q{radius:.0f} 0 {radius:.0f} {radius:.0f}"
        path += f"V{child.middle_y - radius:.0f}q0 {radius:.0f} {radius:.0f} {radius:.0f}"
    return f"{path}H{child.x:.0f}"
