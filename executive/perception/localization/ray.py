"""Localization by a ray that a simulator casts."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from executive.cell.detection import Detection
from executive.cell.frame import Frame
from executive.cell.objects import ObjectClass
from executive.errors import NoDepth
from executive.geometry import Array
from executive.perception.camera_model import pixel_ray
from executive.perception.localization.centre import centre_at

Cast = Callable[[Array, Array], Array | None]
"""Takes origin `(3,)` [m] and direction `(3,)`; returns the first point hit `(3,)` [m], or None."""


class RayLocalizer:
    """Localizes by asking the simulator what the box centre's ray hits.

    That is taken for the object's top, half its known height above its middle. Tutorials do it so; hardware
    has no such thing. The ray is cast when asked, not when the frame was taken: it sees what moved since.
    """

    def __init__(self, classes: Mapping[str, ObjectClass], cast: Cast) -> None:
        self._classes = classes
        self._cast = cast

    def locate(self, detection: Detection, frame: Frame) -> Array:
        """Return the centre of the detected object `(3,)` [m], from the pose stored with the frame.

        Raises:
            NoDepth: The ray hits nothing.
        """
        direction = pixel_ray(frame.matrix, frame.X_WC, detection.centre)
        hit = self._cast(frame.X_WC.position, direction)
        if hit is None:
            column, row = detection.centre
            raise NoDepth(f"the ray through pixel ({column:.0f}, {row:.0f}) of frame {frame.id} hits nothing")
        return centre_at(detection, frame, float(hit[2]) - self._classes[detection.label].height / 2)
