"""Localization by depth image."""

from __future__ import annotations

from collections.abc import Mapping

from executive.cell.detection import Detection
from executive.cell.frame import Frame
from executive.cell.objects import ObjectClass
from executive.geometry import Array
from executive.perception.depth_image import measure_top
from executive.perception.localization.centre import centre_at


class DepthLocalizer:
    """Localizes by the height of the object's top in the depth image: half its known height above its middle.

    Right wherever the object lies, also on another one.
    """

    def __init__(self, classes: Mapping[str, ObjectClass]) -> None:
        self._classes = classes

    def locate(self, detection: Detection, frame: Frame) -> Array:
        """Return the centre of the detected object `(3,)` [m], from the pose stored with the frame.

        Raises:
            NoDepth: The frame has no depth image, or too little of it where the detection lies.
        """
        top = measure_top(detection, frame)
        return centre_at(detection, frame, top - self._classes[detection.label].height / 2)
