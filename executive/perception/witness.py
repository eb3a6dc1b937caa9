"""Witness of an empty table beside the detector: regions of an image that do not look like the table.

The witness knows neither classes nor shapes. The expected image of the table is the local mean of its pixels;
pixels that differ from it by more than the noise of the table, or that a depth image shows above the table,
form regions. Arm, bins, known objects and detections explain regions.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.cell.config import CellConfig
from executive.cell.frame import Box, Frame, Region
from executive.cell.objects import Obstacle
from executive.geometry import Array
from executive.perception.camera_check import list_corners
from executive.perception.camera_model import compute_heights, compute_hull_mask, intersect_plane
from executive.perception.localization import UNKNOWN_HALF_HEIGHT

REDUCTION = 2
"""Factor that reduces the size of the image, for speed; the mean of 2 x 2 pixels also has less noise."""
SEARCH_MARGIN = 0.25
"""Width of the searched margin around the workspace [m]."""
WINDOW = 0.25
"""Side of the window over which the colour of the table is averaged [m]: several objects wide."""
MAX_TABLE_DEVIATION = 45.0
"""Maximum deviation of a pixel of the table from the median colour of the workspace [grey level], for the
first estimate of the table's colour."""
MIN_CONTRAST = 8.0
"""Minimum deviation of a region from the colour of the table [grey level]."""
MIN_CONTRAST_STDS = 3.2
"""Minimum deviation of a region from the colour of the table, in standard deviations of the table's pixels.

With both limits, 330 frames of the cells overhead, wrist, fasteners, depth and overhead_large, empty and with
up to 20 objects, had no region without an object; also none with limits of 7 and 2.8. Each of 250 objects of
these cells was found when its detection was withheld, unless another object hid it.
"""
SAMPLE_STEP = 8
"""Distance between the pixels of which the median is computed."""
MIN_SAMPLES = 100
"""Minimum number of these pixels."""
MIN_TABLE_FRACTION = 0.1
"""Minimum fraction of the window that shows the table, so that the mean is known."""
MIN_HEIGHT = 0.015
"""Minimum height of a region in a depth image above the table [m]."""
DEPTH_WINDOW = 5
"""Side of the window over which heights are averaged [reduced pixel]."""
MIN_AREA_FRACTION = 0.35
"""Minimum area of a region, as a fraction of the area of the smallest class."""
MAX_SIDE = 0.25
"""Maximum longer side of a region [m]; larger regions show the floor, trays or stains."""
EXPLAINED_MARGIN = 0.008
"""Width of the margin around known objects and bins that these explain [m]."""
BOX_MARGIN = 2.0
"""Width of the margin around a detection that it explains [pixel]."""


def find_unexplained(
    frame: Frame, boxes: Iterable[Box], config: CellConfig, obstacles: Iterable[Obstacle]
) -> list[Region]:
    """Return the regions of a frame that table, arm, bins, objects and unknown classes do not explain.

    Args:
        frame: The searched frame.
        boxes: Boxes of detections of unknown classes [pixel].
        config: The cell file, which declares workspace, bins and sizes of the classes.
        obstacles: Known objects on the table.
    """
    table = config.table
    size = (frame.visible.shape[1] // REDUCTION, frame.visible.shape[0] // REDUCTION)
    matrix = frame.matrix.copy()
    matrix[:2] /= REDUCTION
    margins = np.array([-SEARCH_MARGIN, SEARCH_MARGIN])
    corners = np.array([(x, y, 0.0) for x in table.x + margins for y in table.y + margins])
    searched_mask = compute_hull_mask(corners, matrix, frame.X_WC, size, may_be_cut=True)
    if not searched_mask.any():
        return []
    visible_mask = cv2.resize(frame.visible.astype(np.uint8), size, interpolation=cv2.INTER_AREA) > 0
    scale = float(matrix[0, 0]) / frame.compute_depth(np.array([sum(table.x) / 2, sum(table.y) / 2, 0.0]))
    margin = round(EXPLAINED_MARGIN * scale)
    cylinders = (_list_cylinder_points(obstacle) for obstacle in obstacles)
    known_mask = np.zeros(searched_mask.shape, dtype=np.uint8)
    for points in (*map(list_corners, config.build_bins().values()), *cylinders):
        known_mask |= compute_hull_mask(points, matrix, frame.X_WC, size, may_be_cut=True)
    explained_mask = np.asarray(cv2.dilate(known_mask, np.ones((2 * margin + 1,) * 2)), dtype=np.uint8)
    # The known objects stand for the detections of known classes: the ledger may not believe a detection.
    for box in boxes:
        _fill_box(explained_mask, box)
    unexplained_mask = searched_mask & visible_mask & (explained_mask == 0)
    image = cv2.resize(frame.image, size, interpolation=cv2.INTER_AREA).astype(np.float32)
    raised_mask = _find_deviations(image, unexplained_mask, round(WINDOW * scale))
    if frame.depth is not None:
        raised_mask |= _find_raised(frame, frame.depth)
    # A region at the border of the searched part may continue there, as floor and arm do.
    border_mask = cv2.dilate((~(searched_mask & visible_mask)).astype(np.uint8), np.ones((3, 3))) > 0
    min_radius = min(section.radius for section in config.objects.values())
    min_area = MIN_AREA_FRACTION * math.pi * (min_radius * scale) ** 2
    found = _list_components(raised_mask & unexplained_mask, border_mask, min_area, MAX_SIDE * scale)
    return [_make_region(frame, box) for box in found]


def _find_deviations(
    image: NDArray[np.float32], table_mask: NDArray[np.bool_], window: int
) -> NDArray[np.bool_]:
    """Return the mask `(H, W)` of the pixels whose colour differs from that of the table around them.

    `image` is `(H, W, 3)`. `table_mask` selects the pixels that show the table or unknown objects.
    """
    samples = image[table_mask][::SAMPLE_STEP]
    if len(samples) < MIN_SAMPLES:
        return np.zeros_like(table_mask)
    channels = cv2.split(image)
    base = np.where(table_mask, 0.0, np.inf).astype(np.float32)
    deviations = base.copy()
    # A loop over the channels is several times faster than operations on the last axis.
    for channel, median in zip(channels, np.median(samples, axis=0), strict=True):
        np.maximum(deviations, np.abs(channel - median) / MAX_TABLE_DEVIATION, out=deviations)
    # The second mean contains no pixels of unknown objects.
    for _ in range(2):
        weights = (deviations < 1.0).astype(np.float32)
        fractions = cv2.blur(weights, (window, window))
        divisor = np.maximum(fractions, MIN_TABLE_FRACTION)
        deviations = base.copy()
        for channel in channels:
            residuals = cv2.absdiff(channel, cv2.blur(channel * weights, (window, window)) / divisor)
            std = 1.4826 * float(np.median(residuals[weights > 0][::SAMPLE_STEP]))
            np.maximum(deviations, residuals / max(MIN_CONTRAST, MIN_CONTRAST_STDS * std), out=deviations)
    return np.asarray(table_mask & (deviations >= 1.0) & (fractions >= MIN_TABLE_FRACTION))


def _find_raised(frame: Frame, depth: Array) -> NDArray[np.bool_]:
    """Return the mask `(H, W)` of the reduced pixels that a depth image shows above the table."""
    columns = np.arange(REDUCTION // 2, depth.shape[1], REDUCTION)
    rows = np.arange(REDUCTION // 2, depth.shape[0], REDUCTION)
    heights = compute_heights(frame, depth, columns, rows)
    is_known = np.isfinite(heights)
    window = (DEPTH_WINDOW, DEPTH_WINDOW)
    counts = cv2.blur(is_known.astype(np.float32), window)
    means = cv2.blur(np.where(is_known, heights, 0.0).astype(np.float32), window) / np.maximum(counts, 0.1)
    return np.asarray(means > MIN_HEIGHT)


def _list_components(
    mask: NDArray[np.bool_], border_mask: NDArray[np.bool_], min_area: float, max_side: float
) -> Iterator[Box]:
    """Yield the boxes of the connected regions of a mask that have the size of an object [reduced pixel]."""
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    count, labels, statistics, _ = cv2.connectedComponentsWithStats(opened)
    border_labels = np.unique(labels[border_mask])
    for label in range(1, count):
        left, top, width, height, area = map(int, statistics[label])
        if area >= min_area and max(width, height) <= max_side and label not in border_labels:
            yield left, top, left + width, top + height


def _make_region(frame: Frame, box: Box) -> Region:
    """Return the region with a box [reduced pixel]."""
    left, top, right, bottom = (REDUCTION * side for side in box)
    centre = ((left + right) / 2, (top + bottom) / 2)
    position = intersect_plane(frame.matrix, frame.X_WC, centre, UNKNOWN_HALF_HEIGHT)
    scale = 1000 * frame.compute_depth(position) / float(frame.matrix[0, 0])
    place = f"({position[0]:.2f}, {position[1]:.2f}) m"
    size = f"{(right - left) * scale:.0f} x {(bottom - top) * scale:.0f} mm"
    text = f"something of {size} at {place} that no item explains, unlike the table around it"
    return Region((left, top, right, bottom), position, text)


def _list_cylinder_points(obstacle: Obstacle) -> Array:
    """Return points `(N, 3)` [m] on both ends of the cylinder of an obstacle."""
    angles = np.linspace(0.0, 2 * math.pi, 16, endpoint=False)
    x = obstacle.x + obstacle.radius * np.cos(angles)
    y = obstacle.y + obstacle.radius * np.sin(angles)
    return np.concatenate([np.stack([x, y, np.full_like(x, z)], axis=1) for z in (0.0, obstacle.top)])


def _fill_box(mask: NDArray[np.uint8], box: Box) -> None:
    """Set the reduced pixels of a box [pixel] and its margin."""
    start = np.maximum(np.floor(np.subtract(box[:2], BOX_MARGIN) / REDUCTION), 0).astype(int)
    end = np.maximum(np.ceil(np.add(box[2:], BOX_MARGIN) / REDUCTION), 0).astype(int)
    mask[start[1] : end[1], start[0] : end[0]] = 1
