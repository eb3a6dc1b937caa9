"""Layout of a picture of a tree that grows from left to right.

Every depth is a column as wide as its widest node. Every node owns a band of rows that holds it and all
that hangs from it, so nothing can overlap; a subtree's band has room for a frame around it. A node stands
level with its first child, so the picture reads like text, from the top left corner.
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
    """How much room a node needs.

    Attributes:
        width, height: Of its box.
        slot: Of what stands on the line that leads to it, 0 where nothing does.
        name: Of the name of the subtree that begins with it, 0 where none does.
    """

    width: float
    height: float
    slot: float = 0.0
    name: float = 0.0


@dataclass(frozen=True)
class Rectangle:
    """A rectangle; y points down."""

    x: float
    y: float
    width: float
    height: float

    @property
    def right(self) -> float:
        """Its right side."""
        return self.x + self.width

    @property
    def middle(self) -> float:
        """Half of its height."""
        return self.y + self.height / 2


@dataclass(frozen=True)
class Layout:
    """A picture of a tree.

    Attributes:
        boxes: One for every node.
        trunks: x where the lines to the nodes of each depth part from another.
        frames: Around every subtree, by the index of the node that it begins with.
        width, height: Of the whole picture, margins included.
    """

    boxes: tuple[Rectangle, ...]
    trunks: tuple[float, ...]
    frames: dict[int, Rectangle]
    width: float
    height: float


def layout(depths: Sequence[int], children: Sequence[Sequence[int]], sizes: Sequence[Size]) -> Layout:
    """Return where the nodes of a tree stand, given parents before children."""
    columns, trunks = _columns(depths, sizes)
    bands, middles = _bands(children, sizes)
    tops = _tops(children, bands, middles)
    boxes = tuple(
        Rectangle(columns[depth], top + middle - size.height / 2, size.width, size.height)
        for depth, top, middle, size in zip(depths, tops, middles, sizes, strict=True)
    )
    reaches = _reaches(children, sizes, boxes)
    frames = {
        index: Rectangle(
            box.x - FRAME, tops[index] + GAP / 2, reaches[index] - box.x + FRAME, bands[index] - GAP
        )
        for index, box in enumerate(boxes)
        if sizes[index].name
    }
    return Layout(boxes, trunks, frames, max(reaches) + MARGIN, tops[0] + bands[0] + MARGIN - GAP / 2)


def _columns(depths: Sequence[int], sizes: Sequence[Size]) -> tuple[list[float], tuple[float, ...]]:
    """Return where the boxes of every depth begin, and where the lines that lead to them part."""
    columns: list[float] = []
    trunks: list[float] = []
    right = 0.0
    for depth in range(max(depths) + 1):
        here = [size for size, at in zip(sizes, depths, strict=True) if at == depth]
        frame = FRAME if any(size.name for size in here) else 0.0
        trunks.append(right + STEM if depth else MARGIN)
        columns.append(trunks[-1] + (STEM + max(size.slot for size in here) if depth else 0.0) + frame)
        right = columns[-1] + max(size.width for size in here)
    return columns, tuple(trunks)


def _bands(children: Sequence[Sequence[int]], sizes: Sequence[Size]) -> tuple[list[float], list[float]]:
    """Return how high the band of every node is, and how far below its top the node has its middle."""
    bands, middles = [0.0] * len(sizes), [0.0] * len(sizes)
    for index in reversed(range(len(sizes))):
        size, below = sizes[index], children[index]
        head, foot = (FRAME_HEAD, FRAME) if size.name else (0.0, 0.0)
        half = (size.height + GAP) / 2
        level = middles[below[0]] if below else 0.0
        middles[index] = head + max(half, level)
        end = middles[index] - level + sum(bands[child] for child in below)
        bands[index] = max(middles[index] + half, end) + foot
    return bands, middles


def _tops(children: Sequence[Sequence[int]], bands: Sequence[float], middles: Sequence[float]) -> list[float]:
    """Return where the band of every node begins."""
    tops = [MARGIN - GAP / 2] * len(bands)
    for index, below in enumerate(children):
        top = tops[index] + middles[index] - (middles[below[0]] if below else 0.0)
        for child in below:
            tops[child] = top
            top += bands[child]
    return tops


def _reaches(
    children: Sequence[Sequence[int]], sizes: Sequence[Size], boxes: Sequence[Rectangle]
) -> list[float]:
    """Return how far to the right everything reaches that hangs from a node, frame included."""
    reaches = [0.0] * len(sizes)
    for index in reversed(range(len(sizes))):
        size, box = sizes[index], boxes[index]
        reach = max([box.right, *(reaches[child] for child in children[index])])
        reaches[index] = max(reach + FRAME, box.x + size.name) if size.name else reach
    return reaches
