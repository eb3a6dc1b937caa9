"""Layout of a picture of a tree that grows from left to right.

Each depth is a column as wide as its widest node. Each node has a horizontal band for itself and its
descendants, so nodes cannot overlap; the band of a subtree includes its frame. The middle of a node is level
with the middle of its first child.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

MARGIN = 16.0
"""Margin of the picture [pixel]."""
GAP = 10.0
"""Vertical gap between nodes [pixel]."""
STEM = 16.0
"""Length of each horizontal part of a connecting line [pixel]."""
FRAME, FRAME_HEAD = 9.0, 20.0
"""Distance of a frame from its nodes, and height of the name in a frame [pixel]."""

ChildLists = Sequence[Sequence[int]]
"""Indices of the children of each node."""


@dataclass(frozen=True)
class Size:
    """Sizes of the parts of a node [pixel].

    Attributes:
        width, height: Size of the box.
        slot: Length of the text on the line to the node, or 0.
        name: Length of the name of the subtree that starts with the node, or 0.
    """

    width: float
    height: float
    slot: float = 0.0
    name: float = 0.0


@dataclass(frozen=True)
class Rectangle:
    """A rectangle in the picture [pixel]; y points down."""

    x: float
    y: float
    width: float
    height: float

    @property
    def right(self) -> float:
        """X of the right side."""
        return self.x + self.width

    @property
    def middle(self) -> float:
        """Y of the middle."""
        return self.y + self.height / 2


@dataclass(frozen=True)
class Layout:
    """Layout of a picture of a tree [pixel].

    Attributes:
        boxes: Box of each node.
        trunks: x of the vertical part of the lines to the nodes of each depth.
        frames: Frame of each subtree, by the index of its first node.
        width, height: Size of the picture with margins.
    """

    boxes: tuple[Rectangle, ...]
    trunks: tuple[float, ...]
    frames: dict[int, Rectangle]
    width: float
    height: float


def compute_layout(depths: Sequence[int], children: ChildLists, sizes: Sequence[Size]) -> Layout:
    """Return the layout of nodes in an order with parents before children."""
    columns, trunks = _place_columns(depths, sizes)
    bands, middles = _compute_bands(children, sizes)
    tops = _place_bands(children, bands, middles)
    boxes = tuple(
        Rectangle(columns[depth], top + middle - size.height / 2, size.width, size.height)
        for depth, top, middle, size in zip(depths, tops, middles, sizes, strict=True)
    )
    right_ends = _find_right_ends(children, sizes, boxes)
    frames = {
        index: Rectangle(
            box.x - FRAME, tops[index] + GAP / 2, right_ends[index] - box.x + FRAME, bands[index] - GAP
        )
        for index, box in enumerate(boxes)
        if sizes[index].name
    }
    return Layout(boxes, trunks, frames, max(right_ends) + MARGIN, tops[0] + bands[0] + MARGIN - GAP / 2)


def _place_columns(depths: Sequence[int], sizes: Sequence[Size]) -> tuple[list[float], tuple[float, ...]]:
    """Return x of the boxes of each depth, and x at which the lines to these boxes branch."""
    columns: list[float] = []
    trunks: list[float] = []
    right = 0.0
    for depth in range(max(depths) + 1):
        column = [size for size, node_depth in zip(sizes, depths, strict=True) if node_depth == depth]
        frame = FRAME if any(size.name for size in column) else 0.0
        trunks.append(right + STEM if depth else MARGIN)
        columns.append(trunks[-1] + (STEM + max(size.slot for size in column) if depth else 0.0) + frame)
        right = columns[-1] + max(size.width for size in column)
    return columns, tuple(trunks)


def _compute_bands(children: ChildLists, sizes: Sequence[Size]) -> tuple[list[float], list[float]]:
    """Return the height of the band of each node, and y of the node's middle in its band."""
    bands, middles = [0.0] * len(sizes), [0.0] * len(sizes)
    for index in reversed(range(len(sizes))):
        size, node_children = sizes[index], children[index]
        head, foot = (FRAME_HEAD, FRAME) if size.name else (0.0, 0.0)
        half = (size.height + GAP) / 2
        first_middle = middles[node_children[0]] if node_children else 0.0
        middles[index] = head + max(half, first_middle)
        end = middles[index] - first_middle + sum(bands[child] for child in node_children)
        bands[index] = max(middles[index] + half, end) + foot
    return bands, middles


def _place_bands(children: ChildLists, bands: Sequence[float], middles: Sequence[float]) -> list[float]:
    """Return y of the top of each band."""
    tops = [MARGIN - GAP / 2] * len(bands)
    for index, node_children in enumerate(children):
        top = tops[index] + middles[index] - (middles[node_children[0]] if node_children else 0.0)
        for child in node_children:
            tops[child] = top
            top += bands[child]
    return tops


def _find_right_ends(children: ChildLists, sizes: Sequence[Size], boxes: Sequence[Rectangle]) -> list[float]:
    """Return x of the right end of each node with its descendants and frames."""
    right_ends = [0.0] * len(sizes)
    for index in reversed(range(len(sizes))):
        size, box = sizes[index], boxes[index]
        right = max([box.right, *(right_ends[child] for child in children[index])])
        right_ends[index] = max(right + FRAME, box.x + size.name) if size.name else right
    return right_ends
