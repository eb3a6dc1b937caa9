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
        confidence: Confidence, 0 to 1.
        box: Bounding box of the whole object in the image [pixel].
        rival: Confidence of the second most likely class for this box, 0 to 1; 0 if unknown.
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
    """Detections of a detector in a frame, maybe none.

    A detector puts all detections into `found`. Before a skill reads the answer, the cell moves some
    of them to `doubtful` and `unknown` (`executive.perception.detectors.screening`).

    Attributes:
        detector: Name of the detector in the cell file.
        found: Confident detections of known classes, most confident first.
        error_rates: Error rates of the detector.
        doubtful: Detections below the threshold, or with a second class that is more than half as likely.
        unknown: Detections at or above the threshold with labels that the cell file does not declare.
    """

    detector: str
    found: tuple[Detection, ...]
    error_rates: ErrorRates
    doubtful: tuple[Detection, ...] = ()
    unknown: tuple[Detection, ...] = ()

    def describe_doubt(self, detection: Detection) -> str:
        """Return a message: nothing certain was found, and why `detection`, the best one, is doubtful."""
        threshold = self.error_rates.threshold
        second_class = f"with another class at {detection.rival:.2f}"
        limit = f"< {threshold:.2f}" if detection.confidence < threshold else second_class
        return (
            f"detector {self.detector} found nothing certain: at best a {detection.label} "
            f"at {detection.confidence:.2f} {limit}"
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class Detections(Answer):
    """Answer of a detector, with the frame and the region that the detector searched.

    Attributes:
        frame: The searched frame.
        view: Name of the searched region of the image: `table` (the workspace) or `full`.
        area: Searched region of the image [pixel].
    """

    frame: Frame
    view: str
    area: Box

    def is_in_area(self, points: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Return a mask `(N,)` of the points `(N, 3)` [m] in the world that the searched region shows.

        `margin` is the minimum distance of an image point to the border of the region [pixel].
        """
        return self.frame.is_in_area(points, self.area, margin)

    def is_searched(self, points: Array) -> NDArray[np.bool_]:
        """Return a mask `(N,)` of the points `(N, 3)` [m] at which an object would be completely visible."""
        return self.is_in_area(points) & self.frame.is_unoccluded(points)


@dataclass(frozen=True, eq=False)
class Observation:
    """A detection localized in the world.

    Attributes:
        detection: The detection.
        position: Centre of the object `(3,)` [m] in the world.
        std: Standard deviation of the random error of the position along each axis [m].
        confident: False if the detection is doubtful or contradicted.
        contradiction: Sentence with the evidence against the detected class, or "".
    """

    detection: Detection
    position: Array
    std: float
    confident: bool = True
    contradiction: str = ""
