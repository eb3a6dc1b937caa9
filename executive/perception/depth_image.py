"""Height of the top of an object, measured in a depth image."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.cell.frame import Detection, Frame
from executive.errors import NoDepth
from executive.geometry import Array

MIDDLE_FRACTION = 0.6
"""Evaluated fraction of the width and height of a box; pixels near the sides may show other objects."""
PATCH_FRACTION = 0.3
"""Side of the patches over which heights are averaged, as a fraction of the longer side of the box."""
TOP_QUANTILE = 0.9
"""Quantile of the mean heights of all patches; this quantile is the measured height of the top.

From a distance of 1.2 m, a D435 measured the heights of the shipped classes at 280 positions: mean error
2.5 mm, maximum error 9 mm.
"""
MIN_VALID_FRACTION = 0.1
"""Minimum fraction of the evaluated pixels that must have a depth."""


def measure_top_height(detection: Detection, frame: Frame) -> float:
    """Return the height of the top of a detected object above the table [m].

    Raises:
        NoDepth: The frame has no depth image, or too few evaluated pixels have a depth.
    """
    if frame.depth is None:
        advice = f"set `localization: plane` in the cell file, or `depth` of camera {frame.camera}"
        raise NoDepth(f"frame {frame.id} has no depth image; {advice}")
    columns, rows = _select_pixels(detection, frame.depth.shape[::-1])
    heights = _compute_heights(frame, frame.depth, columns, rows)
    valid_count = int(np.isfinite(heights).sum())
    min_count = max(1, math.ceil(MIN_VALID_FRACTION * heights.size))
    if valid_count < min_count:
        left, top, right, bottom = detection.box
        raise NoDepth(
            f"{valid_count} of {heights.size} pixels in the middle of the box ({left:.0f}, {top:.0f}, "
            f"{right:.0f}, {bottom:.0f}) of frame {frame.id} have a depth; {min_count} are required"
        )
    return float(np.quantile(_average_patches(heights, detection), TOP_QUANTILE))


def _select_pixels(detection: Detection, size: tuple[int, ...]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return columns and rows of the pixels in the middle of a box, clipped to an image of `size` [pixel]."""
    left, top, right, bottom = detection.box
    x, y = detection.centre
    half_width, half_height = MIDDLE_FRACTION * (right - left) / 2, MIDDLE_FRACTION * (bottom - top) / 2
    columns = np.arange(max(0, math.floor(x - half_width)), min(size[0], math.ceil(x + half_width)))
    rows = np.arange(max(0, math.floor(y - half_height)), min(size[1], math.ceil(y + half_height)))
    return columns, rows


def _compute_heights(frame: Frame, depth: Array, columns: NDArray[np.intp], rows: NDArray[np.intp]) -> Array:
    """Return the heights `(rows, columns)` [m] above the table of the given pixels, NaN if unknown."""
    u, v = np.meshgrid(columns + 0.5, rows + 0.5)
    # Vectors in the camera frame from the camera to the points at depth 1 m.
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(frame.matrix).T
    visible_depth = np.where(frame.visible, depth, np.nan)[np.ix_(rows, columns)]
    return np.asarray(frame.X_WC.position[2] + visible_depth * (rays @ frame.X_WC.rotation[2]))


def _average_patches(heights: Array, detection: Detection) -> Array:
    """Return the mean heights `(N,)` [m] of the square patches around all pixels with a known height."""
    left, top, right, bottom = detection.box
    side = max(1, round(PATCH_FRACTION * max(right - left, bottom - top)))
    is_known = np.isfinite(heights)
    # The quotient of two blurred images is the mean of the known heights in each patch.
    sums, counts = (
        cv2.blur(values, (side, side), borderType=cv2.BORDER_CONSTANT)
        for values in (np.where(is_known, heights, 0.0), is_known.astype(np.float64))
    )
    return np.asarray(sums[is_known] / counts[is_known])
