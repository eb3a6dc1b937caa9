"""Screening of the answers of detectors: validity, visibility, labels and confidences of the boxes.

Every answer of every kind of detector is screened before a skill reads it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

from executive.cell.detection import Answer, Detection
from executive.cell.frame import Frame
from executive.cell.protocols import Detector
from executive.errors import Crowded, Unavailable
from executive.perception.detectors.requests import ChangedRequest

MIN_VISIBLE_FRACTION = 0.7
"""Minimum fraction of a box that the arm must not occlude; other boxes are ignored."""
MAX_BOXES = 60
"""Maximum number of boxes in one answer, including doubtful boxes and unknown labels. Shipped cells have at
most 20 objects, and the time for the assignment of boxes to items grows more than linearly."""
MAX_COORDINATE = 1e5
"""Maximum absolute coordinate of a box [pixel]: images are smaller, and squares of much larger coordinates
overflow."""
MAX_LABEL_LENGTH = 100
"""Maximum number of characters of a label, which appears in messages and on the terminal."""
MAX_RIVAL_RATIO = 0.5
"""Maximum ratio of the confidences of second and first class of a detection that is not doubtful."""


def screen_answer(answer: Answer, frame: Frame, view: str, labels: Collection[str]) -> Answer:
    """Return an answer with its detections divided into `confident`, `doubtful` and `unknown`.

    Boxes that the arm occludes, and detections with unknown labels below the threshold, are omitted.

    Args:
        answer: Answer with all detections in `confident`.
        frame: The searched frame.
        view: Name of the searched region, for an error message.
        labels: Class names in the cell file.

    Raises:
        Crowded: There are more than `MAX_BOXES` boxes.
        Unavailable: A box, a confidence or a label is invalid.
    """
    if len(answer.confident) > MAX_BOXES:
        raise Crowded(
            f"detector {answer.detector} found {len(answer.confident)} boxes in the view {view}, which "
            f"cannot all be objects; at most {MAX_BOXES} are allowed: raise `floor` of the detector in "
            "the cell file, or use another detector"
        )
    if invalid := next((one for one in answer.confident if not _is_valid(one)), None):
        raise Unavailable(
            f"detector {answer.detector} returned an invalid box: {invalid.label[:MAX_LABEL_LENGTH]!r} "
            f"{invalid.confidence:g} at {invalid.box}"
        )
    threshold = answer.error_rates.threshold
    visible = [
        one for one in answer.confident if frame.compute_visible_fraction(one.box) >= MIN_VISIBLE_FRACTION
    ]
    known = [one for one in visible if one.label in labels]
    return replace(
        answer,
        confident=tuple(one for one in known if _is_confident(one, threshold)),
        doubtful=tuple(one for one in known if not _is_confident(one, threshold)),
        unknown=tuple(one for one in visible if one.label not in labels and one.confidence >= threshold),
    )


@dataclass(frozen=True, eq=False)
class ScreenedDetector:
    """A detector whose answers are screened; implements `executive.cell.protocols.Detector`.

    Attributes:
        detector: The detector.
        name: Name of the detector in the cell file.
        labels: Class names in the cell file.
    """

    detector: Detector
    name: str
    labels: Collection[str]

    def request(self, frame: Frame, view: str) -> ChangedRequest:
        """Start to search a view of a frame: `table` (the workspace) or `full` (the whole image)."""
        request = self.detector.request(frame, view)
        return ChangedRequest(
            request, lambda answer: screen_answer(answer, frame, view, self.labels), self.name
        )


def screen_detectors(detectors: Mapping[str, Detector], labels: Collection[str]) -> dict[str, Detector]:
    """Return detectors with screened answers, by name; `labels` are the class names in the cell file."""
    return {name: ScreenedDetector(detector, name, labels) for name, detector in detectors.items()}


def _is_confident(detection: Detection, threshold: float) -> bool:
    """Return True if a detection is confident enough, and its second class is at most half as likely."""
    confidence = detection.confidence
    return confidence >= threshold and detection.second_confidence <= MAX_RIVAL_RATIO * confidence


def _is_valid(detection: Detection) -> bool:
    """Return True if a detection has a valid box, a valid confidence and a printable label."""
    left, top, right, bottom = detection.box
    # All comparisons with NaN are False.
    is_in_range = all(abs(edge) <= MAX_COORDINATE for edge in detection.box)
    is_printable = detection.label.isprintable() and len(detection.label) <= MAX_LABEL_LENGTH
    return is_in_range and left <= right and top <= bottom and 0 <= detection.confidence <= 1 and is_printable
