"""Brightness, contrast and colour of the workspace in a frame, and their measured ranges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import cv2
import numpy as np

from executive.cell.config import Section, TableConfig
from executive.cell.frame import Frame
from executive.perception.visibility import compute_hull_mask

MIN_PIXELS = 400
"""Minimum number of visible pixels of the workspace for the computation of statistics."""
ABSOLUTE_TOLERANCE = 6.0
"""Minimum tolerance of a statistic outside the measured range [grey level]."""
RELATIVE_TOLERANCE = 0.08
"""Tolerance as a fraction of the limit of the range; the larger of the two tolerances applies."""


@dataclass(frozen=True)
class FrameStatistics:
    """Statistics of the workspace in one frame, all in grey levels from 0 to 255.

    Medians describe the table also if objects cover a part of it.

    Attributes:
        brightness: Median over the pixels of the mean of the three colours.
        contrast: Median absolute deviation from `brightness`.
        red, green, blue: Median of each colour over the pixels.
    """

    brightness: float
    contrast: float
    red: float
    green: float
    blue: float


class FrameRange(Section):
    """Minimum and maximum of each statistic over the measured frames [grey level]."""

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
        values = {name: [asdict(sample)[name] for sample in samples] for name in FrameRange.model_fields}
        ranges = {name: (round(min(each), 1), round(max(each), 1)) for name, each in values.items()}
        return FrameRange.model_validate(ranges)

    def describe_difference(self, statistics: FrameStatistics) -> str:
        """Return a text with name, value and range of each statistic outside its range, or ""."""
        differences = []
        for name, value in asdict(statistics).items():
            low, high = getattr(self, name)
            if not low - _compute_tolerance(low) <= value <= high + _compute_tolerance(high):
                differences.append(f"{name} {value:.0f}, measured {low:.0f} to {high:.0f}")
        return "; ".join(differences)


def compute_frame_statistics(frame: Frame, table: TableConfig) -> FrameStatistics | None:
    """Return the statistics of the workspace; None if it is not completely in the image, or occluded.

    Args:
        frame: The frame.
        table: Section with the position of the workspace.
    """
    height, width = frame.image.shape[:2]
    corners = np.array([(x, y, 0.0) for x in table.x for y in table.y])
    mask = compute_hull_mask(corners, frame.matrix, frame.X_WC, (width, height))
    if mask is None or np.count_nonzero(mask := mask & frame.visible) < MIN_PIXELS:
        return None
    # The mean of 3 x 3 pixels removes most of the image noise, which would increase the contrast.
    colours = cv2.blur(frame.image, (3, 3))[mask].astype(float)
    grey = colours.mean(axis=1)
    brightness = float(np.median(grey))
    red, green, blue = (float(value) for value in np.median(colours, axis=0))
    return FrameStatistics(brightness, float(np.median(np.abs(grey - brightness))), red, green, blue)


def _compute_tolerance(limit: float) -> float:
    return max(ABSOLUTE_TOLERANCE, RELATIVE_TOLERANCE * limit)
