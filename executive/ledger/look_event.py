"""Content of the event `look` as JSON-serializable values."""

from __future__ import annotations

from collections.abc import Sequence

from executive.cell.detection import Detections, Observation


def describe_look(detections: Detections, observations: Sequence[Observation]) -> dict[str, object]:
    """Return frame, camera, detector and view of a look, and each of its detections.

    Args:
        detections: Detections in one frame.
        observations: These detections, localized.
    """
    frame = detections.frame
    return {
        "frame": frame.id,
        "camera": frame.camera,
        "detector": detections.detector,
        "view": detections.view,
        "found": [_describe(one) for one in observations if one.confident],
        "unsure": [_describe(one) for one in observations if not one.confident],
        "unknown": [detection.label for detection in detections.unknown],
    }


def _describe(observation: Observation) -> dict[str, object]:
    detection, contradiction = observation.detection, observation.contradiction
    return {
        "label": detection.label,
        "confidence": round(detection.confidence, 4),
        "box": [round(float(edge), 2) for edge in detection.box],
        "position": [round(float(value), 4) for value in observation.position],
        **({"contradiction": contradiction} if contradiction else {}),
    }
