"""Event of a look: the detections in a frame, localized."""

from __future__ import annotations

from collections.abc import Sequence

from executive.cell.detection import Detections, Observation
from executive.cell.plain import rounded
from executive.events import DetectedObject, FrameSearched


def frame_searched(detections: Detections, observations: Sequence[Observation]) -> FrameSearched:
    """Return the event of a look.

    Args:
        detections: Detections in one frame.
        observations: These detections, localized.
    """
    frame = detections.frame
    return FrameSearched(
        frame.id,
        frame.camera,
        detections.detector,
        detections.view,
        [_detected_object(one) for one in observations if one.confident],
        [_detected_object(one) for one in observations if not one.confident],
        [detection.label for detection in detections.unknown],
    )


def _detected_object(observation: Observation) -> DetectedObject:
    detection = observation.detection
    return DetectedObject(
        detection.label,
        round(detection.confidence, 4),
        rounded(detection.box, 2),
        rounded(observation.position, 4),
        observation.contradiction,
    )
