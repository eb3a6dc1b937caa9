"""Height of an object's top in a depth image."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.errors import NoDepth
from executive.geometry import Array
from executive.messages import Detection, Frame

PART = 0.6
"""Share of a box, each way, that is looked at: what is nearer to its sides may be a neighbour."""
PATCH = 0.3
"""Side of the patches whose mean height counts, as a share of the box's longer side: noise fades in them."""
TOP = 0.9
"""Share of the patches that are taken to lie below the object's top.

With the shares above it finds the top of the shipped classes, seen by a D435 from 1.2 m, within 2.5 mm in
the mean and 9 mm at worst, in 280 places.
"""
LEAST_VALID = 0.1
"""Share of the pixels looked at that must have a depth."""


def measure_top(detection: Detection, frame: Frame) -> float:
    """Return the height of the object's top over the table [m].

    Raises:
        NoDepth: The frame has no depth image, or too little of it where the detection lies.
    """
    if frame.depth is None:
        raise NoDepth(
            f"frame {frame.id} has no depth image; localize by plane, or give camera {frame.camera} one"
        )
    columns, rows = _middle(detection, frame.depth.shape[::-1])
    heights = _heights(frame, frame.depth, columns, rows)
    valid = int(np.isfinite(heights).sum())
    least = max(1, math.ceil(LEAST_VALID * heights.size))
    if valid < least:
        left, top, right, bottom = detection.box
        raise NoDepth(
            f"{valid} of {heights.size} pixels in the middle of the box ({left:.0f}, {top:.0f}, "
            f"{right:.0f}, {bottom:.0f}) of frame {frame.id} have a depth; {least} are needed"
        )
    return float(np.quantile(_patches(heights, detection), TOP))


def _middle(detection: Detection, size: tuple[int, ...]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return columns and rows of the pixels in the middle of a box, those that lie in the image."""
    left, top, right, bottom = detection.box
    ranges = []
    for low, high, limit in ((left, right, size[0]), (top, bottom, size[1])):
        middle, half = (low + high) / 2, PART * (high - low) / 2
        ranges.append(np.arange(max(0, math.floor(middle - half)), min(limit, math.ceil(middle + half))))
    return ranges[0], ranges[1]


def _heights(frame: Frame, depth: Array, columns: NDArray[np.intp], rows: NDArray[np.intp]) -> Array:
    """Return the heights over the table `(rows, columns)` [m] of what pixels show, NaN if unknown."""
    u, v = np.meshgrid(columns + 0.5, rows + 0.5)
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(frame.matrix).T
    seen = np.where(frame.visible, depth, np.nan)[np.ix_(rows, columns)]
    return np.asarray(frame.X_WC.position[2] + seen * (rays @ frame.X_WC.rotation[2]))


def _patches(heights: Array, detection: Detection) -> Array:
    """Return the mean heights `(N,)` [m] of the patches around every pixel with a height."""
    left, top, right, bottom = detection.box
    side = max(1, round(PATCH * max(right - left, bottom - top)))
    known = np.isfinite(heights)
    sums, counts = (
        cv2.blur(values, (side, side), borderType=cv2.BORDER_CONSTANT)
        for values in (np.where(known, heights, 0.0), known.astype(np.float64))
    )
    return np.asarray(sums[known] / counts[known])
