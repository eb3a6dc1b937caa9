"""Screening of detector answers: their validity, and the visibility, label and confidence of each box.

The answers of every kind of detector go through `screen` before a skill reads them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

from executive.cell.detection import Answer, Detection
from executive.cell.frame import Frame
from executive.cell.protocols import Detector
from executive.errors import Crowded, Unavailable
from executive.perception.detectors.requests import ChangedRequest

MIN_VISIBLE_SHARE = 0.7
"""Smallest visible share of a box that counts; the arm may hide the rest."""
MAX_BOXES = 60
"""Largest number of boxes in one answer, doubtful ones and unknown labels included. Shipped cells hold at
most 20 objects, and the time to match boxes with items grows faster than their number."""
MAX_PIXEL = 1e5
"""Largest valid coordinate of a box [pixel]: no image is larger, and the squares of much larger coordinates
overflow."""
MAX_LABEL = 100
"""Largest number of characters of a label: it appears in messages and on the terminal."""
MAX_SECOND_RATIO = 0.5
"""Largest ratio of the second to the first class confidence at which a detection counts."""


def screen(answer: Answer, frame: Frame, view: str, labels: Collection[str]) -> Answer:
    """Return an answer whose detections are divided into found, doubtful and unknown ones.

    Boxes that the arm hides are left out, and so are detections of unknown labels below the threshold.

    Args:
        answer: Answer with all detections in `found`.
        frame: The searched image.
        view: Searched part of the image, for an error message.
        labels: Class names that the cell knows.

    Raises:
        Crowded: There are more boxes than there can be objects.
        Unavailable: A box, a confidence or a label is impossible.
    """
    if len(answer.found) > MAX_BOXES:
        raise Crowded(
            f"detector {answer.detector} found {len(answer.found)} boxes in the view {view}, which "
            f"cannot all be objects; at most {MAX_BOXES} are allowed: raise `floor` of the detector in "
            "the cell file, or use another detector"
        )
    if invalid := next((one for one in answer.found if not _is_valid(one)), None):
        raise Unavailable(
            f"detector {answer.detector} gave an invalid box: {invalid.label[:MAX_LABEL]!r} "
            f"{invalid.confidence:g} at {invalid.box}"
        )
    threshold = answer.error_rates.threshold
    visible = [one for one in answer.found if frame.compute_visible_fraction(one.box) >= MIN_VISIBLE_SHARE]
    known = [one for one in visible if one.label in labels]
    return replace(
        answer,
        found=tuple(one for one in known if _is_confident(one, threshold)),
        doubtful=tuple(one for one in known if not _is_confident(one, threshold)),
        unknown=tuple(one for one in visible if one.label not in labels and one.confidence >= threshold),
    )


@dataclass(frozen=True, eq=False)
class ScreenedDetector:
    """A detector whose answers are screened; implements `executive.cell.protocols.Detector`.

    Attributes:
        detector: The detector.
        name: Its name in the cell file.
        labels: Class names that the cell knows.
    """

    detector: Detector
    name: str
    labels: Collection[str]

    def request(self, frame: Frame, view: str) -> ChangedRequest:
        """Start to search `frame`: the `table` part or the `full` image."""
        request = self.detector.request(frame, view)
        return ChangedRequest(request, lambda answer: screen(answer, frame, view, self.labels), self.name)


def screen_detectors(detectors: Mapping[str, Detector], labels: Collection[str]) -> dict[str, Detector]:
    """Return the detectors of a cell by name, with screened answers; `labels` are the classes it knows."""
    return {name: ScreenedDetector(detector, name, labels) for name, detector in detectors.items()}


def _is_confident(detection: Detection, threshold: float) -> bool:
    """Return True if a detection is confident enough, and its second class at most half as likely."""
    confidence = detection.confidence
    return confidence >= threshold and detection.rival <= MAX_SECOND_RATIO * confidence


def _is_valid(detection: Detection) -> bool:
    """Return True if a detection has a possible box, a possible confidence and a printable label."""
    left, top, right, bottom = detection.box
    # The comparisons are False for numbers that are not finite.
    is_in_range = all(abs(edge) <= MAX_PIXEL for edge in detection.box)
    is_printable = detection.label.isprintable() and len(detection.label) <= MAX_LABEL
    return is_in_range and left <= right and top <= bottom and 0 <= detection.confidence <= 1 and is_printable
