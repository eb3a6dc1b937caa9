"""Which parts of a frame a detector looks at, and how what it finds there becomes one answer."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from executive.cell.detection import Detection
from executive.cell.frame import Box
from executive.errors import InputError

Part = tuple[int, int, int, int]
"""Left, top, right, bottom [pixel] of a part of an image."""

TILE_OVERLAP = 0.25
"""Share of its side that a tile shares with the next: more than an object, so each is whole in one tile."""
MAX_CUT_DISTANCE = 0.01
"""A box closer than this share of the tile's side to the next tile may be cut off there."""
MIN_DUPLICATE_IOU = 0.7
"""Intersection over union above which two boxes are one object seen twice; objects that touch stay below."""
MIN_SAME_IOU, MIN_CONTAINED_SHARE = 0.5, 0.7
"""Intersection over union, or over the smaller box, above which boxes of two tiles show one object."""


@dataclass(frozen=True)
class ViewDetection:
    """A detection and the part of the frame it was found in.

    Attributes:
        detection: Its box is in the frame's pixels.
        part: Where the detector looked.
    """

    detection: Detection
    part: Part


def list_parts(view: str, table_view: Part, size: tuple[int, int]) -> list[Part]:
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


def search_parts(
    image: NDArray[np.uint8],
    parts: Sequence[Part],
    find: Callable[[NDArray[np.uint8]], Iterable[Detection]],
    class_map: Mapping[str, str],
) -> list[Detection]:
    """Return every object in some parts of a frame once, most confident first.

    Args:
        image: The frame `(H, W, 3)`, RGB.
        parts: The parts to search.
        find: Returns the objects in a part, their boxes in its pixels.
        class_map: From the names that `find` gives to the cell's, where they differ.
    """
    findings = []
    for part in parts:
        left, top, right, bottom = part
        for found in find(image[top:bottom, left:right]):
            x0, y0, x1, y1 = found.box
            box = left + x0, top + y0, left + x1, top + y1
            label = class_map.get(found.label, found.label)
            findings.append(ViewDetection(replace(found, label=label, box=box), part))
    return merge_findings(findings, (image.shape[1], image.shape[0]))


def merge_findings(findings: Sequence[ViewDetection], size: tuple[int, int]) -> list[Detection]:
    """Return every object once, most confident first.

    Where parts overlap, the box that is whole in its part wins over one that the part's border cuts off,
    then the more confident one.

    Args:
        findings: Detections of all parts.
        size: Width and height of the frame [pixel].
    """
    ranked = sorted(findings, key=lambda finding: (_is_cut(finding, size), -finding.detection.confidence))
    is_same = _is_same_object([finding.detection.box for finding in ranked])
    kept: list[int] = []
    for number, finding in enumerate(ranked):
        if not any(is_same[number, other] and finding.part != ranked[other].part for other in kept):
            kept.append(number)
    return sorted((ranked[number].detection for number in kept), key=lambda found: -found.confidence)


def remove_duplicates(found: Sequence[Detection]) -> list[Detection]:
    """Return `found`, most confident first, without boxes that lie on a more confident one."""
    if len(found) < 2:
        return list(found)
    from supervision import box_non_max_suppression

    # The rank instead of the confidence, so that of equally confident ones the first is kept.
    ranked = np.array([(*detection.box, -rank) for rank, detection in enumerate(found)])
    keep = box_non_max_suppression(ranked, MIN_DUPLICATE_IOU)
    return [detection for detection, is_kept in zip(found, keep, strict=True) if is_kept]


def _is_same_object(boxes: Sequence[Box]) -> NDArray[np.bool_]:
    """Return for every pair of boxes of different parts whether they show one object, cut off or not."""
    if len(boxes) < 2:
        return np.zeros((len(boxes), len(boxes)), dtype=np.bool_)
    from supervision import OverlapMetric, box_iou_batch

    corners = np.array(boxes)
    contained = box_iou_batch(corners, corners, OverlapMetric.IOS) > MIN_CONTAINED_SHARE
    return np.asarray((box_iou_batch(corners, corners) > MIN_SAME_IOU) | contained)


def _is_cut(finding: ViewDetection, size: tuple[int, int]) -> bool:
    """Tell whether a box reaches a border of its part beyond which the frame goes on."""
    left, top, right, bottom = finding.detection.box
    part = finding.part
    margin = MAX_CUT_DISTANCE * (part[2] - part[0])
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
    count = math.ceil((length - TILE_OVERLAP * side) / (side * (1 - TILE_OVERLAP)))
    return [round(index * (length - side) / (count - 1)) for index in range(count)]
