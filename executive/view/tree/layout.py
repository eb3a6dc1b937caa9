"""Layout of a drawing of a tree that grows from left to right.

Every depth is a column as wide as its widest node. Every node has a band of rows for itself and its
descendants, so that nothing overlaps; the band of a subtree has room for a frame. A node is level with its
first child, so that the drawing reads like text, from the top left corner.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

MARGIN = 16.0
GAP = 10.0
STEM = 16.0
FRAME = 9.0
FRAME_HEAD = 20.0


@dataclass(frozen=True)
class Size:
    """Size of the box and the texts of a node [pixel].

    Attributes:
        width, height: Size of the box.
        slot: Length of the text on the line to the node, 0 without a text.
        name: Length of the name of the subtree that begins with the node, 0 without a subtree.
    """

    width: float
    height: float
    slot: float = 0.0
    name: float = 0.0


@dataclass(frozen=True)
class Rectangle:
    """A rectangle [pixel]; y points down."""

    x: float
    y: float
    width: float
    height: float

    @property
    def right(self) -> float:
        """Horizontal coordinate of the right side."""
        return self.x + self.width

    @property
    def middle(self) -> float:
        """Vertical coordinate of the centre."""
        return self.y + self.height / 2


@dataclass(frozen=True)
class Layout:
    """Layout of a tree [pixel].

    Attributes:
        boxes: Box of every node.
        trunks: x of the vertical line to the nodes of each depth.
        frames: Frame around every subtree, by the index of its first node.
        width, height: Size of the drawing with its margins.
    """

    boxes: tuple[Rectangle, ...]
    trunks: tuple[float, ...]
    frames: dict[int, Rectangle]
    width: float
    height: float


def layout(depths: Sequence[int], children: Sequence[Sequence[int]], sizes: Sequence[Size]) -> Layout:
    """Return the layout of the nodes of a tree, with parents before children."""
    columns, trunks = _place_columns(depths, sizes)
    bands, middles = _size_bands(children, sizes)
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
    """Return x of the boxes, and x of the vertical line to them, by depth."""
    columns: list[float] = []
    trunks: list[float] = []
    right = 0.0
    for depth in range(max(depths) + 1):
        sizes_at_depth = [size for size, at in zip(sizes, depths, strict=True) if at == depth]
        frame = FRAME if any(size.name for size in sizes_at_depth) else 0.0
        trunks.append(right + STEM if depth else MARGIN)
        columns.append(
            trunks[-1] + (STEM + max(size.slot for size in sizes_at_depth) if depth else 0.0) + frame
        )
        right = columns[-1] + max(size.width for size in sizes_at_depth)
    return columns, tuple(trunks)


def _size_bands(children: Sequence[Sequence[int]], sizes: Sequence[Size]) -> tuple[list[float], list[float]]:
    """Return the height of every node's band, and the distance from its top to the node's centre."""
    bands, middles = [0.0] * len(sizes), [0.0] * len(sizes)
    for index in reversed(range(len(sizes))):
        size, child_indices = sizes[index], children[index]
        head, foot = (FRAME_HEAD, FRAME) if size.name else (0.0, 0.0)
        half = (size.height + GAP) / 2
        level = middles[child_indices[0]] if child_indices else 0.0
        middles[index] = head + max(half, level)
        end = middles[index] - level + sum(bands[child] for child in child_indices)
        bands[index] = max(middles[index] + half, end) + foot
    return bands, middles


def _place_bands(
    children: Sequence[Sequence[int]], bands: Sequence[float], middles: Sequence[float]
) -> list[float]:
    """Return y of the top of the band of every node."""
    tops = [MARGIN - GAP / 2] * len(bands)
    for index, child_indices in enumerate(children):
        top = tops[index] + middles[index] - (middles[child_indices[0]] if child_indices else 0.0)
        for child in child_indices:
            tops[child] = top
            top += bands[child]
    return tops


def _find_right_ends(
    children: Sequence[Sequence[int]], sizes: Sequence[Size], boxes: Sequence[Rectangle]
) -> list[float]:
    """Return x of the right end of every node with its descendants, including frames."""
    right_ends = [0.0] * len(sizes)
    for index in reversed(range(len(sizes))):
        size, box = sizes[index], boxes[index]
        right_end = max([box.right, *(right_ends[child] for child in children[index])])
        right_ends[index] = max(right_end + FRAME, box.x + size.name) if size.name else right_end
    return right_ends
