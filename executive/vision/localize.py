"""From a detection to a point in the world."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from executive.errors import NoDepth
from executive.geometry import Array
from executive.messages import Detection, Frame, ObjectClass


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
        height = self._classes[detection.label].height / 2
        pixel = np.array([*detection.centre, 1.0])
        direction = frame.X_WC.rotation @ np.linalg.solve(frame.matrix, pixel)
        origin = frame.X_WC.position
        if abs(direction[2]) < 1e-9 or (height - origin[2]) / direction[2] <= 0:
            raise NoDepth(
                f"the ray through pixel ({detection.centre[0]:.0f}, {detection.centre[1]:.0f}) of frame "
                f"{frame.id} does not meet the plane {height * 1000:.0f} mm above the table"
            )
        return origin + (height - origin[2]) / direction[2] * direction
