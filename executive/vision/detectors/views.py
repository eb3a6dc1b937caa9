"""Which parts of a frame a detector looks at, and how what it finds there becomes one answer."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from executive.errors import InputError
from executive.messages import Box, Detection

Part = tuple[int, int, int, int]
"""Left, top, right, bottom [pixel] of a part of an image."""

OVERLAP = 0.25
"""Share of its side that a tile shares with the next: more than an object, so each is whole in one tile."""
CUT = 0.01
"""A box closer than this share of the tile's side to the next tile may be cut off there."""
DUPLICATE = 0.7
"""Overlap from which two boxes are one object seen twice; objects that touch stay below it."""


@dataclass(frozen=True)
class Finding:
    """A detection and the part of the frame it was found in.

    Attributes:
        detection: Its box is in the frame's pixels.
        part: Where the detector looked.
    """

    detection: Detection
    part: Part


def parts_of(view: str, table_view: Part, size: tuple[int, int]) -> list[Part]:
    """Return the parts of a frame to search.

    Args:
        view: `table`, the square that shows the workspace, or `full`, tiles of that size over everything.
        table_view: That square [pixel].
        size: Width and height of the frame [pixel].

    Raises:
        InputError: The view is unknown.
    """
    if view == "table":
        return [table_view]
    if view != "full":
        raise InputError(f'a frame has no view "{view}"; there are table and full')
    side = table_view[2] - table_view[0]
    columns, rows = (_starts(length, side) for length in size)
    return [
        (left, top, min(left + side, size[0]), min(top + side, size[1])) for top in rows for left in columns
    ]


def merge(findings: Sequence[Finding], size: tuple[int, int]) -> list[Detection]:
    """Return every object once, most confident first.

    Where parts overlap, the box that is whole in its part wins over one that the part's border cuts off,
    then the more confident one.

    Args:
        findings: What was found in all parts.
        size: Width and height of the frame [pixel].
    """
    ranked = sorted(findings, key=lambda finding: (_is_cut(finding, size), -finding.detection.confidence))
    kept: list[Finding] = []
    for finding in ranked:
        if not any(_same_object(finding, other) for other in kept):
            kept.append(finding)
    return sorted((finding.detection for finding in kept), key=lambda detection: -detection.confidence)


def without_duplicates(found: Sequence[Detection]) -> list[Detection]:
    """Return `found`, most confident first, without boxes that lie on a more confident one."""
    kept: list[Detection] = []
    for detection in found:
        if all(iou(detection.box, other.box) < DUPLICATE for other in kept):
            kept.append(detection)
    return kept


def intersection(one: Box, other: Box) -> float:
    """Return the area [pixel²] that two boxes share."""
    width = min(one[2], other[2]) - max(one[0], other[0])
    height = min(one[3], other[3]) - max(one[1], other[1])
    return max(width, 0.0) * max(height, 0.0)


def area(box: Box) -> float:
    """Return the area of a box [pixel²]."""
    return max(box[2] - box[0], 0.0) * max(box[3] - box[1], 0.0)


def iou(one: Box, other: Box) -> float:
    """Return the intersection of two boxes over their union, 0 to 1."""
    shared = intersection(one, other)
    return shared / max(area(one) + area(other) - shared, 1e-9)


def _same_object(one: Finding, other: Finding) -> bool:
    """Tell whether two findings of different parts are one object, cut off in one of them or not."""
    if one.part == other.part:
        return False
    a, b = one.detection.box, other.detection.box
    return iou(a, b) > 0.5 or intersection(a, b) > 0.7 * min(area(a), area(b))


def _is_cut(finding: Finding, size: tuple[int, int]) -> bool:
    """Tell whether a box reaches a border of its part beyond which the frame goes on."""
    left, top, right, bottom = finding.detection.box
    part = finding.part
    margin = CUT * (part[2] - part[0])
    return (
        (part[0] > 0 and left - part[0] < margin)
        or (part[1] > 0 and top - part[1] < margin)
        or (part[2] < size[0] and part[2] - right < margin)
        or (part[3] < size[1] and part[3] - bottom < margin)
    )


def _starts(length: int, side: int) -> list[int]:
    """Return where tiles of `side` begin so that they cover `length` evenly, neighbours overlapping."""
    if length <= side:
        return [0]
    count = math.ceil((length - OVERLAP * side) / (side * (1 - OVERLAP)))
    return [round(index * (length - side) / (count - 1)) for index in range(count)]
