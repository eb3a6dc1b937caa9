"""Event of a look: the detections in a frame, localized."""

from __future__ import annotations

from collections.abc import Sequence

from executive.cell.detection import Detections, Observation
from executive.cell.plain import rounded
from executive.events import DetectedObject, FrameSearched


def describe_look(detections: Detections, observations: Sequence[Observation]) -> FrameSearched:
    """Return the event of a look; `observations` are its localized detections."""
    frame = detections.frame
    return FrameSearched(
        frame.id, frame.camera, detections.detector, detections.view,
        [_describe(one) for one in observations if one.confident],
        [_describe(one) for one in observations if not one.confident],
        [detection.label for detection in detections.unknown],
    )  # fmt: skip


def _describe(one: Observation) -> DetectedObject:
    confidence, box = round(one.detection.confidence, 4), rounded(one.detection.box, 2)
    return DetectedObject(one.detection.label, confidence, box, rounded(one.position, 4), one.contradiction)
