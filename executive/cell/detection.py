"""Detections of objects in a frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from executive.cell.error_rates import ErrorRates
from executive.cell.frame import Box, Frame
from executive.geometry import Array


@dataclass(frozen=True)
class Detection:
    """One object that a detector reports.

    Attributes:
        label: Class name.
        confidence: 0 to 1.
        box: Bounding box of the whole object [pixel] in the frame's image.
        rival: Confidence of the second class for this box, 0 to 1; 0 if unknown.
    """

    label: str
    confidence: float
    box: Box
    rival: float = 0.0

    @property
    def centre(self) -> tuple[float, float]:
        """Centre of the box [pixel]."""
        left, top, right, bottom = self.box
        return (left + right) / 2, (top + bottom) / 2


@dataclass(frozen=True)
class Answer:
    """Answer of a detector to a frame; it may be empty.

    Attributes:
        detector: Name of the detector in the cell file.
        found: Everything at or above its floor, most confident first.
        error_rates: Error rates of that detector.
    """

    detector: str
    found: tuple[Detection, ...]
    error_rates: ErrorRates


@dataclass(frozen=True, eq=False)
class Detections:
    """Detections in one frame; they may be none.

    Attributes:
        frame: The searched image.
        found: Detections at or above the threshold, most confident first.
        detector: Name of the detector.
        error_rates: Error rates of that detector.
        view: Name of the searched part of the frame: `table` or `full`.
        area: Searched part of the frame [pixel].
        doubtful: Detections below the threshold or less than twice as likely as another class.
        unknown: Detections at or above the threshold with labels that the cell does not know.
    """

    frame: Frame
    found: tuple[Detection, ...]
    detector: str
    error_rates: ErrorRates
    view: str
    area: Box
    doubtful: tuple[Detection, ...] = ()
    unknown: tuple[Detection, ...] = ()

    def is_in_area(self, points: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Return a mask `(N,)` of the points `(N, 3)` [m] of the world that lie in the searched area.

        `margin` is the smallest distance of a point to the border of the area [pixel].
        """
        return self.frame.is_in_area(points, self.area, margin)

    def is_searched(self, points: Array) -> NDArray[np.bool_]:
        """Return a mask `(N,)` of the points `(N, 3)` [m] at which an object would be seen completely."""
        return self.is_in_area(points) & self.frame.is_unobstructed(points)


@dataclass(frozen=True, eq=False)
class Glimpse:
    """A detection that does not count as one.

    It is below the threshold, or `contradiction` is evidence against its class. `position` is `(3,)` [m].
    """

    detection: Detection
    position: Array
    contradiction: str = ""
