"""Content of the event `look` as JSON-serializable values."""

from __future__ import annotations

from collections.abc import Sequence

from executive.cell.detection import Detection, Detections, Glimpse
from executive.geometry import Array


def describe_look(
    detections: Detections, positions: Sequence[Array], glimpses: Sequence[Glimpse]
) -> dict[str, object]:
    """Return frame, camera, detector and view of a look, and each of its detections.

    Args:
        detections: Detections in one frame.
        positions: Positions of `detections.found` `(3,)` [m], in the same order.
        glimpses: Detections below the threshold, or contradicted by evidence about their class.
    """
    frame = detections.frame
    return {
        "frame": frame.id,
        "camera": frame.camera,
        "detector": detections.detector,
        "view": detections.view,
        "found": [_describe(*pair) for pair in zip(detections.found, positions, strict=True)],
        "unsure": [_describe_glimpse(glimpse) for glimpse in glimpses],
        "unknown": [detection.label for detection in detections.unknown],
    }


def _describe_glimpse(glimpse: Glimpse) -> dict[str, object]:
    described = _describe(glimpse.detection, glimpse.position)
    return {**described, "contradiction": glimpse.contradiction} if glimpse.contradiction else described


def _describe(detection: Detection, position: Array) -> dict[str, object]:
    return {
        "label": detection.label,
        "confidence": round(detection.confidence, 4),
        "box": [round(float(edge), 2) for edge in detection.box],
        "position": [round(float(value), 4) for value in position],
    }
