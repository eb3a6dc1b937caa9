"""Localization: positions in the world from detections in an image."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Literal

from executive.cell.bins import BIN_THICKNESS, Bin
from executive.cell.detection import Detection, Detections, Observation
from executive.cell.frame import Frame
from executive.cell.objects import ObjectClass
from executive.errors import NoDepth
from executive.geometry import Array
from executive.perception.camera_model import compute_pixel_ray, intersect_plane
from executive.perception.depth_image import measure_top_height
from executive.perception.evidence import describe_size_contradiction, describe_top_contradiction

HeightMethod = Callable[[Detection, Frame, ObjectClass], float]
"""Function that returns the height of the centre of a detected object [m], or raises NoDepth."""

RayTest = Callable[[Array, Array], Array | None]
"""Function of origin `(3,)` [m] and direction `(3,)` of a ray; returns the first hit `(3,)` [m], or None."""


@dataclass(frozen=True, eq=False)
class CellLocalizer:
    """Localizes detections and checks their classes; implements `executive.cell.protocols.Localizer`.

    The centre of an object is the intersection of the ray through the centre of the box with a horizontal
    plane, whose height `find_height` determines.

    Attributes:
        find_height: Method that determines the height of the centre of an object.
        classes: Classes of the cell by label.
        bins: Bins of the cell.
    """

    find_height: HeightMethod
    classes: Mapping[str, ObjectClass]
    bins: Collection[Bin] = ()

    def locate(self, detection: Detection, frame: Frame) -> Array:
        """Return the centre of the detected object `(3,)` [m] in the world.

        Raises:
            NoDepth: The height is unknown, or the ray does not intersect the plane in front of the camera.
        """
        height = self.find_height(detection, frame, self.classes[detection.label])
        try:
            return intersect_plane(frame.matrix, frame.X_WC, detection.centre, height)
        except ValueError:
            column, row = detection.centre
            raise NoDepth(
                f"the ray through pixel ({column:.0f}, {row:.0f}) of frame {frame.id} does not intersect "
                f"the plane {height * 1000:.0f} mm above the table"
            ) from None

    def localize(self, detections: Detections) -> list[Observation]:
        """Return the observations of all doubtful detections, then of all confident detections.

        A doubtful detection that cannot be localized is omitted if there is a confident detection.

        Raises:
            NoDepth: A detection cannot be localized and is not omitted.
        """
        confident = [self._observe(detections, detection) for detection in detections.confident]
        doubtful = []
        for detection in detections.doubtful:
            try:
                doubtful.append(self._observe(detections, detection, is_doubtful=True))
            except NoDepth:
                if not confident:
                    raise
        return [*doubtful, *confident]

    def _observe(
        self, detections: Detections, detection: Detection, *, is_doubtful: bool = False
    ) -> Observation:
        """Return the observation of one detection: position, standard deviation and contradiction."""
        frame = detections.frame
        position = self.locate(detection, frame)
        std = detections.error_rates.jitter * frame.compute_depth(position) / float(frame.matrix[0, 0])
        contradiction = "" if is_doubtful else self._describe_contradiction(detections, detection, position)
        return Observation(detection, position, std, not (is_doubtful or contradiction), contradiction)

    def _describe_contradiction(self, detections: Detections, detection: Detection, position: Array) -> str:
        """Return a text with evidence against the detected class; "" if none, or for an object in a bin."""
        if any(bin.contains(position, BIN_THICKNESS) for bin in self.bins):
            return ""
        frame, image_region, object_class = detections.frame, detections.area, self.classes[detection.label]
        return describe_size_contradiction(
            detection, position, frame, image_region, object_class
        ) or describe_top_contradiction(detection, position, frame, image_region, self.classes)


def build_localizer(
    method: Literal["plane", "depth", "ray"],
    classes: Mapping[str, ObjectClass],
    bins: Collection[Bin] = (),
    cast_ray: RayTest | None = None,
) -> CellLocalizer:
    """Return the localizer of a cell.

    Args:
        method: Source of the height of an object: class (`plane`), depth image (`depth`), ray test (`ray`).
        classes: Classes of the cell by label.
        bins: Bins of the cell; classes of objects in bins are not checked.
        cast_ray: Ray test of the simulator, for the method `ray`.
    """
    if method == "ray":
        assert cast_ray is not None, "the method `ray` needs a simulator"
        return CellLocalizer(partial(_find_height_by_ray, cast_ray), classes, bins)
    return CellLocalizer(_find_height_by_depth if method == "depth" else _find_height_on_table, classes, bins)


def _find_height_on_table(detection: Detection, frame: Frame, object_class: ObjectClass) -> float:
    """Return the height of the centre [m] of an object that stands on the table."""
    del detection, frame
    return object_class.height / 2


def _find_height_by_depth(detection: Detection, frame: Frame, object_class: ObjectClass) -> float:
    """Return the height of the centre of an object [m], from the height of its top in the depth image.

    Raises:
        NoDepth: The frame has no depth image, or too few depth values in the box.
    """
    return measure_top_height(detection, frame) - object_class.height / 2


def _find_height_by_ray(
    cast_ray: RayTest, detection: Detection, frame: Frame, object_class: ObjectClass
) -> float:
    """Return the height of the centre of an object [m], from the hit of a simulated ray on its top.

    The ray test uses the current scene, not the scene at capture; a hardware cell has no ray test.

    Raises:
        NoDepth: The ray hits nothing.
    """
    hit = cast_ray(frame.X_WC.position, compute_pixel_ray(frame.matrix, frame.X_WC, detection.centre))
    if hit is None:
        column, row = detection.centre
        raise NoDepth(f"the ray through pixel ({column:.0f}, {row:.0f}) of frame {frame.id} hits nothing")
    return float(hit[2]) - object_class.height / 2
