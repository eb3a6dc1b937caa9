"""Regions of an image for the search by a detector, and merging of the detections in all regions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from executive.cell.detection import Detection
from executive.cell.frame import Box
from executive.errors import InputError

Region = tuple[int, int, int, int]
"""Left, top, right and bottom side [pixel] of a region of an image."""

TILE_OVERLAP = 0.25
"""Minimum overlap of neighbouring tiles, as a fraction of their side; larger than any object."""
MAX_TRUNCATION_DISTANCE = 0.01
"""Maximum distance, as a fraction of the width of the region, of a truncated box from its border."""
MIN_DUPLICATE_IOU = 0.7
"""Minimum intersection over union of two boxes of one object; it is lower for touching objects."""
MIN_SAME_IOU, MIN_CONTAINED_FRACTION = 0.5, 0.7
"""Minimum intersection over union, or over the smaller box, of boxes of one object in two tiles."""


@dataclass(frozen=True)
class RegionDetection:
    """A detection and the searched region of the image.

    Attributes:
        detection: Detection with the box in pixels of the image.
        region: Region in which the object was detected.
    """

    detection: Detection
    region: Region


def list_regions(view: str, table_view: Region, size: tuple[int, int]) -> list[Region]:
    """Return the regions of an image to search for a view.

    Args:
        view: `table`, the region `table_view`, or `full`, tiles of the same size that cover the image.
        table_view: Square region that shows the workspace.
        size: Width and height of the image [pixel].

    Raises:
        InputError: The view is unknown.
    """
    if view == "table":
        return [table_view]
    if view != "full":
        raise InputError(f'there is no view "{view}"; the views are table and full')
    side = table_view[2] - table_view[0]
    columns, rows = (_list_tile_starts(length, side) for length in size)
    return [
        (left, top, min(left + side, size[0]), min(top + side, size[1])) for top in rows for left in columns
    ]


def search_regions(
    image: NDArray[np.uint8],
    regions: Sequence[Region],
    detect: Callable[[NDArray[np.uint8]], Iterable[Detection]],
    class_map: Mapping[str, str],
) -> list[Detection]:
    """Return the detections in regions of an image, one per object, most confident first.

    Args:
        image: The image `(H, W, 3)`, RGB.
        regions: The regions to search.
        detect: Function that returns the detections in a crop, with boxes in pixels of the crop.
        class_map: Class names of the cell by class names from `detect`, if the names differ.
    """
    found = []
    for region in regions:
        left, top, right, bottom = region
        for detection in detect(image[top:bottom, left:right]):
            x0, y0, x1, y1 = detection.box
            box = left + x0, top + y0, left + x1, top + y1
            label = class_map.get(detection.label, detection.label)
            found.append(RegionDetection(replace(detection, label=label, box=box), region))
    return merge_detections(found, (image.shape[1], image.shape[0]))


def merge_detections(found: Sequence[RegionDetection], size: tuple[int, int]) -> list[Detection]:
    """Return one detection per object, most confident first.

    Of several boxes of one object in overlapping regions, a box that is not truncated by the border of its
    region is preferred, then the more confident box.

    Args:
        found: Detections in all regions.
        size: Width and height of the image [pixel].
    """
    ranked = sorted(found, key=lambda each: (_is_truncated(each, size), -each.detection.confidence))
    is_same = _find_same_objects([each.detection.box for each in ranked])
    kept: list[int] = []
    for index, each in enumerate(ranked):
        if not any(is_same[index, other] and each.region != ranked[other].region for other in kept):
            kept.append(index)
    return sorted((ranked[index].detection for index in kept), key=lambda detection: -detection.confidence)


def remove_duplicates(found: Sequence[Detection]) -> list[Detection]:
    """Return `found`, most confident first, without duplicates of a more confident detection."""
    if len(found) < 2:
        return list(found)
    from supervision import box_non_max_suppression

    # Ranks are used instead of confidences, so that the first of equally confident detections is kept.
    ranked = np.array([(*detection.box, -rank) for rank, detection in enumerate(found)])
    keep = box_non_max_suppression(ranked, MIN_DUPLICATE_IOU)
    return [detection for detection, is_kept in zip(found, keep, strict=True) if is_kept]


def _find_same_objects(boxes: Sequence[Box]) -> NDArray[np.bool_]:
    """Return a matrix `(N, N)` that is True for each pair of boxes of one object, truncated or not."""
    if len(boxes) < 2:
        return np.zeros((len(boxes), len(boxes)), dtype=np.bool_)
    from supervision import OverlapMetric, box_iou_batch

    corners = np.array(boxes)
    contained = box_iou_batch(corners, corners, OverlapMetric.IOS) > MIN_CONTAINED_FRACTION
    return np.asarray((box_iou_batch(corners, corners) > MIN_SAME_IOU) | contained)


def _is_truncated(found: RegionDetection, size: tuple[int, int]) -> bool:
    """Return True if a box reaches a border of its region that is not a border of the image."""
    left, top, right, bottom = found.detection.box
    region = found.region
    margin = MAX_TRUNCATION_DISTANCE * (region[2] - region[0])
    return (
        (region[0] > 0 and left - region[0] < margin)
        or (region[1] > 0 and top - region[1] < margin)
        or (region[2] < size[0] and region[2] - right < margin)
        or (region[3] < size[1] and region[3] - bottom < margin)
    )


def _list_tile_starts(length: int, side: int) -> list[int]:
    """Return the first pixels of evenly spaced tiles of width `side` that cover `length` pixels."""
    if length <= side:
        return [0]
    count = math.ceil((length - TILE_OVERLAP * side) / (side * (1 - TILE_OVERLAP)))
    return [round(index * (length - side) / (count - 1)) for index in range(count)]
