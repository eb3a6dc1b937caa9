"""Regions of an image that a detector searches, and merging of the detections in all regions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from executive.cell.detection import Detection
from executive.cell.frame import Box
from executive.errors import InputError
from executive.geometry import Array

Region = tuple[int, int, int, int]
"""Left, top, right and bottom side [pixel] of a region of an image."""
LocatedDetection = tuple[Detection, Region]
"""Detection with the box in pixels of the image, and the region in which the object was detected."""

TILE_OVERLAP = 0.25
"""Minimum overlap of neighbouring tiles, as a fraction of their side; larger than every object."""
MAX_TRUNCATION_DISTANCE = 0.01
"""Maximum distance of a truncated box from the border of its region, as a fraction of the region width."""
MIN_DUPLICATE_IOU = 0.7
"""Minimum intersection over union of two boxes of one object; boxes of touching objects overlap less."""
MIN_TILE_IOU = 0.5
"""Minimum intersection over union of the boxes of one object in two tiles."""
MIN_CONTAINED_FRACTION = 0.7
"""Minimum intersection of the boxes of one object in two tiles, as a fraction of the smaller box."""
MIN_AREA = 1e-9
"""Area that replaces the area of an empty box in a division [pixel²]."""


def list_regions(view: str, table_view: Region, size: tuple[int, int]) -> list[Region]:
    """Return the regions of an image to search for a view.

    Args:
        view: `table` for the region `table_view`; `full` for tiles of this size that cover the image.
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
    width, height = size
    lefts, tops = _list_tile_starts(width, side), _list_tile_starts(height, side)
    return [(left, top, min(left + side, width), min(top + side, height)) for top in tops for left in lefts]


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
    detections: list[LocatedDetection] = []
    for region in regions:
        left, top, right, bottom = region
        for detection in detect(image[top:bottom, left:right]):
            box_left, box_top, box_right, box_bottom = detection.box
            box = left + box_left, top + box_top, left + box_right, top + box_bottom
            label = class_map.get(detection.label, detection.label)
            detections.append((replace(detection, label=label, box=box), region))
    return merge_detections(detections, (image.shape[1], image.shape[0]))


def merge_detections(detections: Sequence[LocatedDetection], size: tuple[int, int]) -> list[Detection]:
    """Return one detection per object, most confident first.

    For an object with boxes in several regions, an untruncated box is preferred to a more confident box.
    `size` is the width and height of the image [pixel].
    """
    candidates = sorted(detections, key=lambda pair: (_is_truncated(pair, size), -pair[0].confidence))
    is_same_object = _compare_objects([detection.box for detection, _ in candidates])
    selection: list[int] = []
    for index, (_, region) in enumerate(candidates):
        selected_elsewhere = [each for each in selection if candidates[each][1] != region]
        if not is_same_object[index, selected_elsewhere].any():
            selection.append(index)
    merged = (candidates[index][0] for index in selection)
    return sorted(merged, key=lambda detection: -detection.confidence)


def remove_duplicates(detections: Sequence[Detection]) -> list[Detection]:
    """Return the detections without duplicates of more confident ones; the input is most confident first."""
    if len(detections) < 2:
        return list(detections)
    ious, _ = compute_overlaps(np.array([detection.box for detection in detections]))
    kept: list[int] = []
    for index in range(len(detections)):
        if not (ious[index, kept] > MIN_DUPLICATE_IOU).any():
            kept.append(index)
    return [detections[index] for index in kept]


def compute_overlaps(boxes: Array) -> tuple[Array, Array]:
    """Return the area of the intersection of each pair of boxes, divided by the union and by the smaller box.

    The arrays have the shape `(N, N)`. The import of `supervision`, which has this function, takes 0.5 s.

    Args:
        boxes: Left, top, right and bottom side of each box `(N, 4)`.
    """
    low = np.maximum(boxes[:, None, :2], boxes[:, :2])
    high = np.minimum(boxes[:, None, 2:], boxes[:, 2:])
    intersections = (high - low).clip(0.0).prod(axis=2)
    areas = (boxes[:, 2:] - boxes[:, :2]).prod(axis=1)
    unions = areas[:, None] + areas - intersections
    smaller_areas = np.minimum(areas[:, None], areas)
    return intersections / unions.clip(MIN_AREA), intersections / smaller_areas.clip(MIN_AREA)


def _compare_objects(boxes: Sequence[Box]) -> NDArray[np.bool_]:
    """Return a matrix `(N, N)` that is True for each pair of boxes that show one object."""
    if len(boxes) < 2:
        return np.zeros((len(boxes), len(boxes)), dtype=np.bool_)
    ious, contained_fractions = compute_overlaps(np.array(boxes))
    return np.asarray((ious > MIN_TILE_IOU) | (contained_fractions > MIN_CONTAINED_FRACTION))


def _is_truncated(located_detection: LocatedDetection, size: tuple[int, int]) -> bool:
    """Return True if a box reaches a border of its region that is not a border of the image."""
    (left, top, right, bottom), region = located_detection[0].box, located_detection[1]
    margin = MAX_TRUNCATION_DISTANCE * (region[2] - region[0])
    return (
        (region[0] > 0 and left - region[0] < margin)
        or (region[1] > 0 and top - region[1] < margin)
        or (region[2] < size[0] and region[2] - right < margin)
        or (region[3] < size[1] and region[3] - bottom < margin)
    )


def _list_tile_starts(length: int, side: int) -> list[int]:
    """Return the first pixels of evenly spaced tiles of width `side` that together cover `length` pixels."""
    if length <= side:
        return [0]
    count = math.ceil((length - TILE_OVERLAP * side) / (side * (1 - TILE_OVERLAP)))
    return [round(index * (length - side) / (count - 1)) for index in range(count)]
