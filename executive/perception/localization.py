"""Localization: positions in the world from detections in an image."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from executive.cell.frame import Detection, Detections, Frame, Observation
from executive.cell.objects import BIN_THICKNESS, Bin, ObjectClass
from executive.errors import NoDepth
from executive.geometry import Array
from executive.perception import evidence
from executive.perception.camera_model import compute_pixel_ray, intersect_plane, measure_top_height
from executive.perception.yaw import measure_yaw

OUTLINE_DISTANCE = 0.1
"""Minimum distance from bins at which the outline of an object is compared with its class [m]."""
RayTest = Callable[[Array, Array], Array | None]
"""Function of origin `(3,)` [m] and direction `(3,)` of a ray; returns the first hit `(3,)` [m], or None."""

UNKNOWN_HALF_HEIGHT = 0.025
"""Assumed height of the centre of an object of no class above its support [m]."""
UNKNOWN_POSITION_STD = 0.01
"""Standard deviation of the position of an object of no class along each axis [m]: its height is unknown."""


@dataclass(frozen=True, eq=False)
class CellLocalizer:
    """Localizes detections and checks their classes; implements `executive.cell.protocols.Localizer`.

    The centre of an object is the intersection of the ray through the centre of the box with a horizontal
    plane. The height of the plane depends on the method.

    Attributes:
        method: Source of the height of an object: class (`plane`), depth image (`depth`), ray test (`ray`).
        classes: Classes of the cell by label.
        bins: Bins of the cell; classes of objects in bins are not checked.
        cast_ray: Ray test of the simulator, for the method `ray`.
        measures_yaw: True if the yaws of confident detections are measured.
    """

    method: Literal["plane", "depth", "ray"]
    classes: Mapping[str, ObjectClass]
    bins: Collection[Bin] = ()
    cast_ray: RayTest | None = None
    measures_yaw: bool = False

    def locate(self, detection: Detection, frame: Frame) -> Array:
        """Return the centre; NoDepth: unknown height, or no intersection in front of the camera."""
        height = self._find_height(detection, frame)
        try:
            return intersect_plane(frame.matrix, frame.X_WC, detection.centre, height)
        except ValueError:
            column, row = detection.centre
            raise NoDepth(
                f"the ray through pixel ({column:.0f}, {row:.0f}) of frame {frame.id} does not intersect "
                f"the plane {height * 1000:.0f} mm above the table"
            ) from None

    def localize(self, detections: Detections) -> list[Observation]:
        """Return the observations of all doubtful, all unknown, then all confident detections.

        An unknown detection that cannot be localized is omitted, and a doubtful one if there is a confident
        detection.
        """
        confident = [self._observe(detections, detection) for detection in detections.confident]
        others = []
        for detection in (*detections.doubtful, *detections.unknown):
            try:
                others.append(self._observe(detections, detection))
            except NoDepth:
                if detection in detections.doubtful and not confident:
                    raise
        return [*others, *confident]

    def _observe(self, detections: Detections, detection: Detection) -> Observation:
        """Return the observation of one detection: position, yaw, standard deviations and contradiction."""
        frame = detections.frame
        contradiction = ""
        yaw = None
        position = self.locate(detection, frame)
        is_doubtful = detection in detections.doubtful
        std = detections.error_rates.jitter * frame.compute_depth(position) / float(frame.matrix[0, 0])
        if detection.label not in self.classes:
            std = max(std, UNKNOWN_POSITION_STD)
        elif not is_doubtful:
            contradiction = self._describe_contradiction(detections, detection, position)
            object_class = self.classes[detection.label]
            if self.measures_yaw and (found := measure_yaw(detections, detection, position, object_class)):
                yaw, middle = found
                if object_class.grasp_points:
                    position = middle
        is_confident = not (is_doubtful or contradiction)
        return Observation(detection, position, std, frame.stamp, is_confident, contradiction, yaw)

    def _describe_contradiction(self, detections: Detections, detection: Detection, position: Array) -> str:
        """Return a text with evidence against the detected class; "" if there is none.

        The result is also "" for a truncated or occluded box, and for an object in a bin.
        """
        frame = detections.frame
        is_visible = evidence.is_completely_visible(detection, frame, detections.area)
        if not is_visible or any(bin.contains(position, BIN_THICKNESS) for bin in self.bins):
            return ""
        object_class = self.classes[detection.label]
        contradiction = evidence.describe_size_contradiction(detection, position, frame, object_class)
        contradiction = contradiction or evidence.describe_top_contradiction(
            detection, position, frame, object_class
        )
        # The outline of a class with an uneven top is no prism, and a bin is unlike the table, too.
        is_near_bin = any(bin.contains(position, OUTLINE_DISTANCE) for bin in self.bins)
        if contradiction or is_near_bin or not (object_class.footprint and object_class.flat_top):
            return contradiction
        return evidence.describe_outline_contradiction(detections, detection, position, object_class)

    def _find_height(self, detection: Detection, frame: Frame) -> float:
        """Return the height of the centre of a detected object [m].

        The ray test uses the current scene, not the scene at capture; a hardware cell has no ray test.

        Raises:
            NoDepth: The box has too few depth values, or the ray hits nothing.
        """
        object_class = self.classes.get(detection.label)
        half_height = object_class.height / 2 if object_class else UNKNOWN_HALF_HEIGHT
        if self.method == "plane":
            return half_height
        if self.method == "depth":
            return measure_top_height(detection, frame) - half_height
        assert self.cast_ray is not None, "the method `ray` needs a simulator"
        ray = compute_pixel_ray(frame.matrix, frame.X_WC, detection.centre)
        hit = self.cast_ray(frame.X_WC.position, ray / np.linalg.norm(ray))
        if hit is None:
            column, row = detection.centre
            raise NoDepth(f"the ray through pixel ({column:.0f}, {row:.0f}) of frame {frame.id} hits nothing")
        return float(hit[2]) - half_height
