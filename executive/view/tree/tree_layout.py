"""Layout of a picture of a tree that grows from left to right.

The nodes of one depth form a column, which is as wide as its widest node. Each node has a horizontal band for
its box and the bands of its children, so that boxes cannot overlap. A frame encloses each subtree; the band
of its first node includes the frame. The middle of a node has the same y as the middle of its first child.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

MARGIN = 16.0
"""Margin of the picture [pixel]."""
NODE_GAP = 10.0
"""Vertical distance between the boxes of nodes [pixel]."""
EDGE_SEGMENT_LENGTH = 16.0
"""Length of each horizontal part of the line between a node and its child [pixel]."""
FRAME_PADDING = 9.0
"""Distance between a frame and the boxes in it [pixel]."""
FRAME_HEADER = 20.0
"""Height of the part of a frame that contains the name of the subtree [pixel]."""

ChildLists = Sequence[Sequence[int]]
"""Indices of the children of each node, by the index of the node."""


@dataclass(frozen=True)
class NodeSize:
    """Sizes of the parts of a node [pixel].

    Attributes:
        width, height: Size of the box.
        label_width: Width of the label of the line to the node; 0 for no label.
        subtree_name_width: Width of the name of the subtree whose first node this is; 0 for other nodes.
    """

    width: float
    height: float
    label_width: float = 0.0
    subtree_name_width: float = 0.0


@dataclass(frozen=True)
class Rectangle:
    """A rectangle in the picture: its left top corner and its size [pixel]; y points down."""

    x: float
    y: float
    width: float
    height: float

    @property
    def right(self) -> float:
        """The x of the right side [pixel]."""
        return self.x + self.width

    @property
    def middle(self) -> float:
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


def compute_layout(depths: Sequence[int], children: ChildLists, sizes: Sequence[NodeSize]) -> Layout:
    """Return the layout of a tree; its nodes are listed with parents before their children.

    Args:
        depths: Depth of each node; 0 for the root.
        children: Indices of the children of each node.
        sizes: Sizes of the parts of each node.
    """
    columns, edge_xs = _place_columns(depths, sizes)
    bands, middles = _compute_bands(children, sizes)
    tops = _place_bands(children, bands, middles)
    boxes = tuple(
        Rectangle(columns[depth], top + middle - size.height / 2, size.width, size.height)
        for depth, top, middle, size in zip(depths, tops, middles, sizes, strict=True)
    )
    right_ends = _find_right_ends(children, sizes, boxes)
    frames = {}
    for index, box in enumerate(boxes):
        if sizes[index].subtree_name_width:
            x, y = box.x - FRAME_PADDING, tops[index] + NODE_GAP / 2
            width = right_ends[index] - box.x + FRAME_PADDING
            frames[index] = Rectangle(x, y, width, bands[index] - NODE_GAP)
    height = tops[0] + bands[0] + MARGIN - NODE_GAP / 2
    return Layout(boxes, edge_xs, frames, max(right_ends) + MARGIN, height)


def _place_columns(depths: Sequence[int], sizes: Sequence[NodeSize]) -> tuple[list[float], tuple[float, ...]]:
    """Return the x of the boxes of each depth, and the x of the vertical parts of the lines to them."""
    columns: list[float] = []
    edge_xs: list[float] = []
    right = 0.0
    for depth in range(max(depths) + 1):
        column = [size for size, node_depth in zip(sizes, depths, strict=True) if node_depth == depth]
        frame = FRAME_PADDING if any(size.subtree_name_width for size in column) else 0.0
        edge_xs.append(right + EDGE_SEGMENT_LENGTH if depth else MARGIN)
        edge_length = EDGE_SEGMENT_LENGTH + max(size.label_width for size in column) if depth else 0.0
        columns.append(edge_xs[-1] + edge_length + frame)
        right = columns[-1] + max(size.width for size in column)
    return columns, tuple(edge_xs)


def _compute_bands(children: ChildLists, sizes: Sequence[NodeSize]) -> tuple[list[float], list[float]]:
    """Return the height of the band of each node, and the y of the middle of the node in the band."""
    bands, middles = [0.0] * len(sizes), [0.0] * len(sizes)
    for index in reversed(range(len(sizes))):
        size, node_children = sizes[index], children[index]
        header, footer = (FRAME_HEADER, FRAME_PADDING) if size.subtree_name_width else (0.0, 0.0)
        half_height = (size.height + NODE_GAP) / 2
        first_middle = middles[node_children[0]] if node_children else 0.0
        middles[index] = header + max(half_height, first_middle)
        end = middles[index] - first_middle + sum(bands[child] for child in node_children)
        bands[index] = max(middles[index] + half_height, end) + footer
    return bands, middles


def _place_bands(children: ChildLists, bands: Sequence[float], middles: Sequence[float]) -> list[float]:
    """Return the y of the top of each band, given the heights of the bands and the middles in them."""
    tops = [MARGIN - NODE_GAP / 2] * len(bands)
    for index, node_children in enumerate(children):
        top = tops[index] + middles[index] - (middles[node_children[0]] if node_children else 0.0)
        for child in node_children:
            tops[child] = top
            top += bands[child]
    return tops


def _find_right_ends(
    children: ChildLists, sizes: Sequence[NodeSize], boxes: Sequence[Rectangle]
) -> list[float]:
    """Return the x of the right end of each node including its descendants and their frames."""
    right_ends = [0.0] * len(sizes)
    for index in reversed(range(len(sizes))):
        box, name_width = boxes[index], sizes[index].subtree_name_width
        right = max([box.right, *(right_ends[child] for child in children[index])])
        right_ends[index] = max(right + FRAME_PADDING, box.x + name_width) if name_width else right
    return right_ends
