"""Brightness, contrast and colour of the workspace in a frame, and their measured ranges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import numpy as np

from executive.cell.config import CellConfig, Section
from executive.cell.frame import Frame
from executive.perception.camera_model import compute_hull_mask

MIN_PIXELS = 400
"""Minimum number of visible pixels of the workspace for the computation of statistics."""
MIN_FRACTION_OF_PARTIAL_VIEW = 0.03
"""Minimum fraction of an image that shows the workspace if the image may show only a part of it; objects then
cover less than half of the pixels, and the medians are those of the table."""
ABSOLUTE_TOLERANCE = 6.0
"""Minimum tolerance below and above the measured range of a statistic [grey level]."""
RELATIVE_TOLERANCE = 0.08
"""Minimum tolerance below and above the measured range of a statistic, as a fraction of the range limit."""


FrameStatistics = Mapping[str, float]
"""Statistics of the workspace in one frame by name (a field of `FrameRange`) [grey level, 0 to 255]."""


class FrameRange(Section):
    """Minimum and maximum of each statistic over the measured frames [grey level].

    Medians describe the colour of the table even if objects cover a part of the table.

    Attributes:
        brightness: Median over the pixels of the mean of the three colours.
        contrast: Median absolute deviation from the brightness.
        red, green, blue: Median of each colour over the pixels.
    """

    brightness: tuple[float, float]
    contrast: tuple[float, float]
    red: tuple[float, float]
    green: tuple[float, float]
    blue: tuple[float, float]

    @staticmethod
    def compute(samples: Sequence[FrameStatistics]) -> FrameRange | None:
        """Return the ranges of the statistics of several frames; None if there are no frames."""
        if not samples:
            return None
        values = {name: [sample[name] for sample in samples] for name in FrameRange.model_fields}
        ranges = {name: (round(min(column), 1), round(max(column), 1)) for name, column in values.items()}
        return FrameRange.model_validate(ranges)

    def describe_difference(self, statistics: FrameStatistics) -> str:
        """Return a text with name, value and range of each statistic outside its range; "" if none."""
        differences = []
        for name, value in statistics.items():
            lower, upper = getattr(self, name)
            if not lower - _compute_tolerance(lower) <= value <= upper + _compute_tolerance(upper):
                differences.append(f"{name} {value:.0f}, measured {lower:.0f} to {upper:.0f}")
        return "; ".join(differences)


def compute_frame_statistics(frame: Frame, cell: CellConfig) -> FrameStatistics | None:
    """Return the statistics of the workspace; None if a corner is not in view or few pixels are visible.

    The corners may be out of the partial view of a camera, but a larger part of the image must then show the
    workspace.
    """
    is_partial = next(iter(cell.cameras.values())).partial_views
    height, width = frame.image.shape[:2]
    corners = np.array([(x, y, 0.0) for x in cell.table.x for y in cell.table.y])
    mask = compute_hull_mask(corners, frame.matrix, frame.X_WC, (width, height), may_be_cut=is_partial)
    min_pixels = MIN_FRACTION_OF_PARTIAL_VIEW * width * height if is_partial else MIN_PIXELS
    if mask is None or np.count_nonzero(mask := mask & frame.visible) < min_pixels:
        return None
    # Image noise would increase the contrast; the mean of 3 x 3 pixels removes most of the noise.
    colours = cv2.blur(frame.image, (3, 3))[mask].astype(float)
    grey = colours.mean(axis=1)
    brightness = float(np.median(grey))
    contrast = float(np.median(np.abs(grey - brightness)))
    values = brightness, contrast, *np.median(colours, axis=0).tolist()
    return dict(zip(FrameRange.model_fields, values, strict=True))


def _compute_tolerance(range_limit: float) -> float:
    return max(ABSOLUTE_TOLERANCE, RELATIVE_TOLERANCE * range_limit)
