"""Methods to find the height of the centre of a detected object."""

from __future__ import annotations

from collections.abc import Callable

from executive.cell.detection import Detection
from executive.cell.frame import Frame
from executive.cell.objects import ObjectClass
from executive.errors import NoDepth
from executive.geometry import Array
from executive.perception.camera_model import pixel_ray
from executive.perception.depth_image import measure_top

Cast = Callable[[Array, Array], Array | None]
"""Ray test: takes origin `(3,)` [m] and direction `(3,)`; returns the first point hit `(3,)` [m], or None."""


def height_on_table(detection: Detection, frame: Frame, kind: ObjectClass) -> float:
    """Return half the height of the class [m]: the object stands on the table."""
    del detection, frame
    return kind.height / 2


def height_by_depth(detection: Detection, frame: Frame, kind: ObjectClass) -> float:
    """Return the height of the centre [m] below the top that the depth image shows.

    The object may lie on another one.

    Raises:
        NoDepth: The frame has no depth image, or too little depth in the box.
    """
    return measure_top(detection, frame) - kind.height / 2


def height_by_ray(cast: Cast, detection: Detection, frame: Frame, kind: ObjectClass) -> float:
    """Return the height of the centre [m] below the point that a ray of the simulator hits.

    Hardware has no such ray. The simulator casts it at the call and not at capture: an object may have moved
    since.

    Raises:
        NoDepth: The ray hits nothing.
    """
    hit = cast(frame.X_WC.position, pixel_ray(frame.matrix, frame.X_WC, detection.centre))
    if hit is None:
        column, row = detection.centre
        raise NoDepth(f"the ray through pixel ({column:.0f}, {row:.0f}) of frame {frame.id} hits nothing")
    return float(hit[2]) - kind.height / 2
