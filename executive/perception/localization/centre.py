"""The centre of an object, once the height of its middle is known."""

from __future__ import annotations

from executive.cell.detection import Detection
from executive.cell.frame import Frame
from executive.errors import NoDepth
from executive.geometry import Array
from executive.perception.camera_model import intersect_plane


def centre_at(detection: Detection, frame: Frame, height: float) -> Array:
    """Return where the ray through the box's centre is at `height` [m], `(3,)` [m] in the world.

    Raises:
        NoDepth: The ray does not meet that height in front of the camera.
    """
    try:
        return intersect_plane(frame.matrix, frame.X_WC, detection.centre, height)
    except ValueError:
        column, row = detection.centre
        raise NoDepth(
            f"the ray through pixel ({column:.0f}, {row:.0f}) of frame {frame.id} does not meet the plane "
            f"{height * 1000:.0f} mm above the table"
        ) from None
