"""Brightness, contrast and colour of the table in a frame, and their measured ranges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import cv2
import numpy as np

from executive.cell.config import Section, TableConfig
from executive.cell.frame import Frame
from executive.perception.visibility import compute_hull_mask

MIN_PIXELS = 400
"""Smallest number of visible pixels of the workspace from which statistics are computed."""
TOLERANCE = 6.0
"""Accepted distance from the measured range [grey level]."""
RELATIVE_TOLERANCE = 0.08
"""Accepted distance as a share of the limit of the range; the larger of the two tolerances applies."""


@dataclass(frozen=True)
class FrameStatistics:
    """Statistics of the workspace in one frame, all in grey levels from 0 to 255.

    Medians describe the table even if objects cover a part of it.

    Attributes:
        brightness: Median of the mean of the three colours.
        contrast: Median absolute deviation of the brightness.
        red, green, blue: Median of each colour.
    """

    brightness: float
    contrast: float
    red: float
    green: float
    blue: float


class FrameRange(Section):
    """Smallest and largest value of each statistic over the measured frames [grey level]."""

    brightness: tuple[float, float]
    contrast: tuple[float, float]
    red: tuple[float, float]
    green: tuple[float, float]
    blue: tuple[float, float]

    @staticmethod
    def of(samples: Sequence[FrameStatistics]) -> FrameRange | None:
        """Return the ranges over the statistics of some frames, None if there are none."""
        if not samples:
            return None
        values = {name: [asdict(sample)[name] for sample in samples] for name in FrameRange.model_fields}
        ranges = {name: (round(min(each), 1), round(max(each), 1)) for name, each in values.items()}
        return FrameRange.model_validate(ranges)

    def describe_difference(self, statistics: FrameStatistics) -> str:
        """Return each statistic outside its range as text, with its value and range; "" if there is none."""
        differences = []
        for name, value in asdict(statistics).items():
            low, high = getattr(self, name)
            if not low - _tolerance(low) <= value <= high + _tolerance(high):
                differences.append(f"{name} {value:.0f}, measured {low:.0f} to {high:.0f}")
        return "; ".join(differences)


def measure_frame(frame: Frame, table: TableConfig) -> FrameStatistics | None:
    """Return the statistics of the workspace, None if the frame does not show all of it or the arm hides it.

    Args:
        frame: The image.
        table: Declares the workspace.
    """
    height, width = frame.image.shape[:2]
    corners = np.array([(x, y, 0.0) for x in table.x for y in table.y])
    mask = compute_hull_mask(corners, frame.matrix, frame.X_WC, (width, height))
    if mask is None or np.count_nonzero(mask := mask & frame.visible) < MIN_PIXELS:
        return None
    # Averaging over 3 x 3 pixels removes most of the sensor's noise from the contrast.
    colours = cv2.blur(frame.image, (3, 3))[mask].astype(float)
    grey = colours.mean(axis=1)
    brightness = float(np.median(grey))
    red, green, blue = (float(value) for value in np.median(colours, axis=0))
    return FrameStatistics(brightness, float(np.median(np.abs(grey - brightness))), red, green, blue)


def _tolerance(limit: float) -> float:
    return max(TOLERANCE, RELATIVE_TOLERANCE * limit)
