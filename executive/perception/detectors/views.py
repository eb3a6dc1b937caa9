"""Regions of an image that a detector searches, and merging of the detections in all regions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from executive.cell.frame import Box, Detection
from executive.geometry import Array

Region = tuple[int, int, int, int]
"""Left, top, right and bottom side [pixel] of a region of an image."""
LocatedDetection = tuple[Detection, Region]
"""Detection with the box in pixels of the image, and the region in which the object was detected."""
CropSearch = Callable[[NDArray[np.uint8]], Iterable[Detection]]
"""Function that returns the detections in a crop `(H, W, 3)`, RGB, with boxes in pixels of the crop."""

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
    """
    if view == "table":
        return [table_view]
    side = table_view[2] - table_view[0]
    width, height = size
    lefts = _list_tile_starts(width, side)
    tops = _list_tile_starts(height, side)
    return [(left, top, min(left + side, width), min(top + side, height)) for top in tops for left in lefts]


def search_regions(
    image: NDArray[np.uint8], regions: Sequence[Region], detect: CropSearch, class_map: Mapping[str, str]
) -> list[Detection]:
    """Return the detections in regions of an image, one per object, most confident first.

    Args:
        image: The image `(H, W, 3)`, RGB.
        regions: The regions to search.
        detect: Function that searches a crop.
        class_map: Class names of the cell by class names from `detect`, if the names differ.
    """
    detections: list[LocatedDetection] = []
    for region in regions:
        left, top, right, bottom = region
        for detection in detect(image[top:bottom, left:right]):
            label = class_map.get(detection.label, detection.label)
            detections.append((replace(detection.shift(left, top), label=label), region))
    if len(regions) > 1:
        # Another tile shows the whole object; a part of an object may look like another class.
        size = (image.shape[1], image.shape[0])
        detections = [pair for pair in detections if not _is_truncated(pair, size)]
    return merge_detections(detections)


def merge_detections(detections: Sequence[LocatedDetection]) -> list[Detection]:
    """Return one detection per object, which may have boxes in several regions; most confident first."""
    candidates = sorted(detections, key=lambda pair: -pair[0].confidence)
    ious, contained_fractions = compute_overlaps([detection.box for detection, _ in candidates])
    is_same_object = (ious > MIN_TILE_IOU) | (contained_fractions > MIN_CONTAINED_FRACTION)
    regions = np.array([region for _, region in candidates]).reshape(-1, 4)
    is_in_other_region = (regions[:, None] != regions).any(axis=2)
    return [candidates[index][0] for index in _find_unique(is_same_object & is_in_other_region)]


def remove_duplicates(detections: Sequence[Detection]) -> list[Detection]:
    """Return the detections without duplicates of more confident ones; the input is most confident first."""
    ious, _ = compute_overlaps([detection.box for detection in detections])
    return [detections[index] for index in _find_unique(ious > MIN_DUPLICATE_IOU)]


def compute_overlaps(boxes: Sequence[Box]) -> tuple[Array, Array]:
    """Return the intersection of each pair of `N` boxes as a fraction of the union and of the smaller box.

    Both results have the shape `(N, N)`. The import of `supervision`, which has this function, takes 0.5 s.
    """
    sides = np.array(boxes, dtype=np.float64).reshape(-1, 4)
    low = np.maximum(sides[:, None, :2], sides[:, :2])
    high = np.minimum(sides[:, None, 2:], sides[:, 2:])
    intersections = (high - low).clip(0.0).prod(axis=2)
    areas = (sides[:, 2:] - sides[:, :2]).prod(axis=1)
    unions = areas[:, None] + areas - intersections
    smaller_areas = np.minimum(areas[:, None], areas)
    return intersections / unions.clip(MIN_AREA), intersections / smaller_areas.clip(MIN_AREA)


def _find_unique(is_duplicate: NDArray[np.bool_]) -> list[int]:
    """Return the indices of the detections that duplicate no earlier detection of the result.

    `is_duplicate` `(N, N)` is True for each pair of detections of the same object.
    """
    selection: list[int] = []
    for index, row in enumerate(is_duplicate):
        if not row[selection].any():
            selection.append(index)
    return selection


def _is_truncated(located_detection: LocatedDetection, size: tuple[int, int]) -> bool:
    """Return True if a box reaches a border of its region that is not a border of the image."""
    detection, region = located_detection
    margin = MAX_TRUNCATION_DISTANCE * (region[2] - region[0])
    is_inside_image = np.not_equal(region, (0, 0, *size))
    distances = np.subtract(detection.box, region) * (1, 1, -1, -1)
    return bool((is_inside_image & (distances < margin)).any())


def _list_tile_starts(length: int, side: int) -> list[int]:
    """Return the first pixels of evenly spaced tiles of width `side` that together cover `length` pixels."""
    if length <= side:
        return [0]
    count = math.ceil((length - TILE_OVERLAP * side) / (side * (1 - TILE_OVERLAP)))
    return [round(index * (length - side) / (count - 1)) for index in range(count)]
