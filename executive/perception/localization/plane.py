"""Localization by known height."""

from __future__ import annotations

from collections.abc import Mapping

from executive.cell.detection import Detection
from executive.cell.frame import Frame
from executive.cell.objects import ObjectClass
from executive.geometry import Array
from executive.perception.localization.centre import centre_at


class PlaneLocalizer:
    """Localizes by known height: the box centre's ray meets the plane at half the object's height.

    Right for objects that stand on the table; what lies on others needs a depth camera.
    """

    def __init__(self, classes: Mapping[str, ObjectClass]) -> None:
        self._classes = classes

    def locate(self, detection: Detection, frame: Frame) -> Array:
        """Return the centre of the detected object `(3,)` [m], from the pose stored with the frame.

        Raises:
            NoDepth: The ray does not meet the plane in front of the camera.
        """
        return centre_at(detection, frame, self._classes[detection.label].height / 2)
