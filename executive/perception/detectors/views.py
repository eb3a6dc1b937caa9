"""Parts of a frame for a search by a detector, and the merging of the detections of all parts."""

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
"""Overlap of neighbouring tiles, as a share of the side; larger than any object."""
MAX_CUT_DISTANCE = 0.01
"""Largest distance from a border of the tile, as a share of the side, at which a box may be cut off."""
MIN_DUPLICATE_IOU = 0.7
"""Intersection over union above which two boxes show one object; touching objects stay below this value."""
MIN_SAME_IOU, MIN_CONTAINED_SHARE = 0.5, 0.7
"""Intersection over union, or over the smaller box, above which boxes of two tiles show one object."""


@dataclass(frozen=True)
class ViewDetection:
    """A detection and the searched part of the frame.

    Attributes:
        detection: Detection with the box in pixels of the frame.
        part: Part of the frame that contains the detection.
    """

    detection: Detection
    part: Part


def list_parts(view: str, table_view: Part, size: tuple[int, int]) -> list[Part]:
    """Return the parts of a frame to search.

    Args:
        view: `table`, the square that shows the workspace, or `full`, tiles of that size over the frame.
        table_view: Square that shows the workspace [pixel].
        size: Width and height of the frame [pixel].

    Raises:
        InputError: The view is unknown.
    """
    if view == "table":
        return [table_view]
    if view != "full":
        raise InputError(f'a frame has no view "{view}"; there are table and full')
    side = table_view[2] - table_view[0]
    columns, rows = (_list_tile_starts(length, side) for length in size)
    return [
        (left, top, min(left + side, size[0]), min(top + side, size[1])) for top in rows for left in columns
    ]


def search_parts(
    image: NDArray[np.uint8],
    parts: Sequence[Part],
    find: Callable[[NDArray[np.uint8]], Iterable[Detection]],
    class_map: Mapping[str, str],
) -> list[Detection]:
    """Return the detections in parts of a frame, one per object, most confident first.

    Args:
        image: The frame `(H, W, 3)`, RGB.
        parts: The parts to search.
        find: Function that returns the detections in a part, with boxes in pixels of the part.
        class_map: Class names of the cell by class names of `find`, if the names differ.
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
    """Return one detection per object, most confident first.

    If parts overlap, a box inside its part takes precedence over a box that the border of the part cuts off,
    then the more confident box over the less confident box.

    Args:
        findings: Detections of all parts.
        size: Width and height of the frame [pixel].
    """
    ranked = sorted(findings, key=lambda finding: (_is_cut(finding, size), -finding.detection.confidence))
    is_same = _find_same_objects([finding.detection.box for finding in ranked])
    kept: list[int] = []
    for number, finding in enumerate(ranked):
        if not any(is_same[number, other] and finding.part != ranked[other].part for other in kept):
            kept.append(number)
    return sorted((ranked[number].detection for number in kept), key=lambda found: -found.confidence)


def remove_duplicates(found: Sequence[Detection]) -> list[Detection]:
    """Return `found`, most confident first, without duplicates of a more confident detection."""
    if len(found) < 2:
        return list(found)
    from supervision import box_non_max_suppression

    # Ranks replace the confidences, so that the first of equally confident detections is kept.
    ranked = np.array([(*detection.box, -rank) for rank, detection in enumerate(found)])
    keep = box_non_max_suppression(ranked, MIN_DUPLICATE_IOU)
    return [detection for detection, is_kept in zip(found, keep, strict=True) if is_kept]


def _find_same_objects(boxes: Sequence[Box]) -> NDArray[np.bool_]:
    """Return an `(N, N)` matrix, True for each pair of boxes that shows one object, cut off or not."""
    if len(boxes) < 2:
        return np.zeros((len(boxes), len(boxes)), dtype=np.bool_)
    from supervision import OverlapMetric, box_iou_batch

    corners = np.array(boxes)
    contained = box_iou_batch(corners, corners, OverlapMetric.IOS) > MIN_CONTAINED_SHARE
    return np.asarray((box_iou_batch(corners, corners) > MIN_SAME_IOU) | contained)


def _is_cut(finding: ViewDetection, size: tuple[int, int]) -> bool:
    """Return True if a box reaches a border of its part that is not a border of the frame."""
    left, top, right, bottom = finding.detection.box
    part = finding.part
    margin = MAX_CUT_DISTANCE * (part[2] - part[0])
    return (
        (part[0] > 0 and left - part[0] < margin)
        or (part[1] > 0 and top - part[1] < margin)
        or (part[2] < size[0] and part[2] - right < margin)
        or (part[3] < size[1] and part[3] - bottom < margin)
    )


def _list_tile_starts(length: int, side: int) -> list[int]:
    """Return the first pixels of evenly spaced, overlapping tiles of width `side` that cover `length`."""
    if length <= side:
        return [0]
    count = math.ceil((length - TILE_OVERLAP * side) / (side * (1 - TILE_OVERLAP)))
    return [round(index * (length - side) / (count - 1)) for index in range(count)]
