"""Layout of a picture of a tree that grows from left to right.

The nodes of one depth form a column. Each node has a horizontal band that contains its box and the bands of
its children, so that boxes cannot overlap. A frame encloses each subtree, within the band of the first node
of the subtree. A node and its first child are at the same height.
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
"""Distance between a frame and the boxes in the frame [pixel]."""
FRAME_HEADER = 20.0
"""Height of the part of a frame that contains the name of the subtree [pixel]."""

ChildIndices = Sequence[Sequence[int]]
"""Indices of the children of each node, by the index of the node."""


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
            x, y = box.x - FRAME_PADDING, band_tops[index] + NODE_GAP / 2
            width = right_xs[index] - box.x + FRAME_PADDING
            frames[index] = Rectangle(x, y, width, band_heights[index] - NODE_GAP)
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
    band_heights, node_offsets = [0.0] * len(sizes), [0.0] * len(sizes)
    for index in reversed(range(len(sizes))):
        size, node_children = sizes[index], children[index]
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
        box, name_width = boxes[index], sizes[index].subtree_name_width
        right_x = max([box.right_x, *(right_xs[child] for child in children[index])])
        right_xs[index] = max(right_x + FRAME_PADDING, box.x + name_width) if name_width else right_x
    return right_xs
