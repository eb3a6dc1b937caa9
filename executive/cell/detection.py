"""Detections of objects in a frame, and error rates of detectors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from executive.cell.frame import Box, Frame
from executive.geometry import Array


@dataclass(frozen=True)
class ErrorRates:
    """Error rates of a detector in its cell, measured by `executive evaluate` or assumed.

    Attributes:
        threshold: Confidence below which a detection is doubtful, 0 to 1.
        miss_rate: Fraction of the completely visible objects that the detector misses in a frame.
        confusion_rate: Fraction of the detected objects that get a wrong class.
        false_detections: Mean number of false detections (false positives) per frame.
        jitter: Standard deviation of the random error of a box's centre along each axis of the image [pixel].
        repeated: Fraction of the errors that occur again in a second frame from the same camera pose.
        bias: Standard deviation of the systematic error of an object's position, along each axis [m].
        assumption_reason: Reason why the rates are assumed; "" if they are measured.
    """

    threshold: float
    miss_rate: float
    confusion_rate: float
    false_detections: float
    jitter: float
    repeated: float = 0.0
    bias: float = 0.0
    assumption_reason: str = ""


def assume_rates(threshold: float, reason: str) -> ErrorRates:
    """Return conservative error rates for a detector without a measurement under the current conditions.

    In unusual scenes, the embedded detector missed 4 % of the objects, confused 5 % of the objects, and
    repeated most errors in each frame of a scene. Each assumed rate is at least as high.
    """
    return ErrorRates(
        threshold, miss_rate=0.15, confusion_rate=0.05, false_detections=0.2, jitter=2.0, repeated=0.8,
        bias=0.002, assumption_reason=reason,
    )  # fmt: skip


@dataclass(frozen=True)
class Detection:
    """One object that a detector reports.

    Attributes:
        label: Class name.
        confidence: Confidence, 0 to 1.
        box: Bounding box of the whole object in the image [pixel].
        second_confidence: Confidence of the second most probable class of the box, 0 to 1; 0 if unknown.
    """

    label: str
    confidence: float
    box: Box
    second_confidence: float = 0.0

    @property
    def centre(self) -> tuple[float, float]:
        """Centre x and y of the box [pixel]."""
        left, top, right, bottom = self.box
        return (left + right) / 2, (top + bottom) / 2


@dataclass(frozen=True)
class Answer:
    """Result of a detector for one frame: its detections, grouped by certainty.

    A detector puts all detections into `confident`. Before a skill reads the answer, the function
    `executive.perception.detectors.screening.screen_answer` moves detections to `doubtful` and `unknown`.

    Attributes:
        detector: Name of the detector in the cell file.
        confident: Confident detections of known classes, most confident first.
        error_rates: Error rates of the detector.
        doubtful: Detections with a confidence below the threshold, or with a second class that has more than
            half of the confidence of the first class.
        unknown: Detections with labels that the cell file does not declare, above the threshold.
    """

    detector: str
    confident: tuple[Detection, ...]
    error_rates: ErrorRates
    doubtful: tuple[Detection, ...] = ()
    unknown: tuple[Detection, ...] = ()

    def describe_doubt(self, detection: Detection) -> str:
        """Return the message that no detection is confident; `detection` is the best doubtful detection."""
        confidence, threshold = detection.confidence, self.error_rates.threshold
        is_low = confidence < threshold
        second = f"and {detection.second_confidence:.2f} for another class"
        doubt = f"below the threshold {threshold:.2f}" if is_low else second
        best_object = f"a {detection.label} with confidence {confidence:.2f}, {doubt}"
        return f"detector {self.detector} found nothing certain: at best {best_object}"


@dataclass(frozen=True, eq=False, kw_only=True)
class Detections(Answer):
    """Detections of a detector in one frame, with the frame and the searched region of its image.

    Attributes:
        frame: The searched frame.
        view: Name of the searched region of the image: `table` (the workspace) or `full`.
        area: Searched region of the image: left, top, right and bottom side [pixel].
    """

    frame: Frame
    view: str
    area: Box

    def compute_searched_mask(self, points: Array) -> NDArray[np.bool_]:
        """Return a mask `(N,)` of the world points `(N, 3)` [m] that are searched and unoccluded."""
        mask = self.frame.compute_area_mask(points, self.area)
        mask[mask] = self.frame.compute_unoccluded_mask(points[mask])
        return mask


@dataclass(frozen=True, eq=False)
class Observation:
    """A detection localized in the world.

    Attributes:
        detection: The detection.
        position: Centre of the object `(3,)` [m] in the world.
        std: Standard deviation of the random error of the position along each axis [m].
        is_confident: False if the detection is in `Answer.doubtful`, or if `contradiction` is not empty.
        contradiction: Sentence that states how the size or height contradicts the detected class, or "".
    """

    detection: Detection
    position: Array
    std: float
    is_confident: bool = True
    contradiction: str = ""
