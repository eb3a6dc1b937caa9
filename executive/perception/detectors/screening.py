"""Screening of the answers of detectors: validity, visibility, labels and confidences of the boxes.

Every answer of every kind of detector is screened before a skill reads it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from executive.cell.frame import Answer, Detection, Frame
from executive.cell.objects import ObjectClass
from executive.cell.protocols import Detector
from executive.errors import Crowded, Unavailable
from executive.perception.detectors.requests import ChangedRequest

MIN_VISIBLE_FRACTION = 0.7
"""Minimum unoccluded fraction of a box; boxes that the arm occludes more are ignored."""
MAX_BOXES = 60
"""Maximum number of boxes in one answer, including doubtful boxes and unknown labels. Shipped cells have at
most 20 objects, and the time for the assignment of boxes to items grows more than linearly."""
MIN_BOX_SIDE = 2.0
"""Minimum longer side of a box [pixel]; a box in fractions of the image is smaller."""
MAX_BOX_SIDE = 1e5
"""Maximum longer side of a box [pixel]; all images are smaller, and squares of it do not overflow."""
MAX_LABEL_LENGTH = 100
"""Maximum number of characters of a label, which appears in messages and on the terminal."""
MAX_SECOND_CLASS_RATIO = 0.5
"""Maximum confidence of the second class of a confident detection, as a fraction of the first confidence."""


def screen_answer(answer: Answer, frame: Frame, view: str, label_map: Mapping[str, str]) -> Answer:
    """Return an answer with its detections divided into `confident`, `doubtful` and `unknown`.

    Boxes that the arm occludes, and doubtful boxes with unknown labels are omitted. The label of a class that
    looks like another class is replaced by the label of the other class.

    Args:
        answer: Answer with all detections in `confident`.
        frame: The searched frame.
        view: Name of the searched region, for an error message.
        label_map: For each class of the cell, the class that the detectors report for it.

    Raises:
        Crowded: There are more than `MAX_BOXES` boxes.
        Unavailable: A box, a confidence or a label is invalid, or a box does not fit the image.
    """
    if len(answer.confident) > MAX_BOXES:
        problem = f"found {len(answer.confident)} boxes in the view {view}, which cannot all be objects"
        advice = "raise `floor` of the detector in the cell file, or use another detector"
        raise Crowded(f"detector {answer.detector} {problem}; at most {MAX_BOXES} are allowed: {advice}")
    if invalid := next((found for found in answer.confident if not _is_valid(found, frame)), None):
        box = f"{invalid.label[:MAX_LABEL_LENGTH]!r} {invalid.confidence:g} at {invalid.box}"
        image = f"an image of {frame.visible.shape[1]} x {frame.visible.shape[0]} pixels"
        raise Unavailable(f"detector {answer.detector} returned an invalid box: {box} in {image}")
    threshold = answer.error_rates.threshold
    confident: list[Detection] = []
    doubtful: list[Detection] = []
    unknown: list[Detection] = []
    for detection in answer.confident:
        if frame.compute_visible_fraction(detection.box) < MIN_VISIBLE_FRACTION:
            continue
        label = label_map.get(detection.label)
        is_confident = _is_confident(detection, threshold)
        if label:
            (confident if is_confident else doubtful).append(replace(detection, label=label))
        elif is_confident:
            unknown.append(detection)
    return replace(answer, confident=tuple(confident), doubtful=tuple(doubtful), unknown=tuple(unknown))


@dataclass(frozen=True, eq=False)
class ScreenedDetector:
    """Detector with screened answers; implements `executive.cell.protocols.Detector`.

    Attributes:
        detector: The detector.
        name: Name of the detector in the cell file.
        label_map: For each class of the cell, the class that the detectors report for it.
    """

    detector: Detector
    name: str
    label_map: Mapping[str, str]

    def request(self, frame: Frame, view: str) -> ChangedRequest:
        """Start the detection in a view of a frame: `table` (the workspace) or `full` (the whole image)."""
        request = self.detector.request(frame, view)
        return ChangedRequest(
            request, lambda answer: screen_answer(answer, frame, view, self.label_map), self.name
        )


def screen_detectors(
    detectors: Mapping[str, Detector], classes: Mapping[str, ObjectClass]
) -> dict[str, Detector]:
    """Return detectors with screened answers, by name; `classes` are the classes of the cell by label."""
    label_map = {label: object_class.detected_label for label, object_class in classes.items()}
    return {name: ScreenedDetector(detector, name, label_map) for name, detector in detectors.items()}


def _is_confident(detection: Detection, threshold: float) -> bool:
    """Return True if a detection reaches the threshold and has a low confidence of its second class."""
    confidence = detection.confidence
    return confidence >= threshold and detection.second_confidence <= MAX_SECOND_CLASS_RATIO * confidence


def _is_valid(detection: Detection, frame: Frame) -> bool:
    """Return True if a detection has a valid confidence, a printable label, and a valid box in the image."""
    left, top, right, bottom = detection.box
    height, width = frame.visible.shape
    # These comparisons also reject NaN.
    sides = right - left, bottom - top
    is_box = min(sides) >= 0 and MIN_BOX_SIDE <= max(sides) <= MAX_BOX_SIDE
    is_in_image = right >= 0 and bottom >= 0 and left <= width and top <= height
    is_printable = detection.label.isprintable() and len(detection.label) <= MAX_LABEL_LENGTH
    return is_box and is_in_image and 0 <= detection.confidence <= 1 and is_printable
