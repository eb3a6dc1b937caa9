"""Localization of detections, from an image to positions in the world."""

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
from executive.perception.depth_image import measure_top
from executive.perception.evidence import describe_wrong_size, describe_wrong_top

HeightMethod = Callable[[Detection, Frame, ObjectClass], float]
"""Returns the height of the centre of a detected object [m]; raises NoDepth if it cannot be found."""

Cast = Callable[[Array, Array], Array | None]
"""Ray test: takes origin `(3,)` [m] and direction `(3,)`; returns the first point hit `(3,)` [m], or None."""


@dataclass(frozen=True, eq=False)
class CellLocalizer:
    """Localizes detections and checks their class; implements `executive.cell.protocols.Localizer`.

    The centre of an object is the point of known height on the ray through the centre of its box.

    Attributes:
        find_height: Finds the height of the centre of an object.
        classes: Classes of the cell by label.
        bins: Bins of the cell.
    """

    find_height: HeightMethod
    classes: Mapping[str, ObjectClass]
    bins: Collection[Bin] = ()

    def locate(self, detection: Detection, frame: Frame) -> Array:
        """Return the centre of the detected object `(3,)` [m], from the camera pose of the frame.

        Raises:
            NoDepth: The height is unknown, or the ray does not meet it in front of the camera.
        """
        height = self.find_height(detection, frame, self.classes[detection.label])
        try:
            return intersect_plane(frame.matrix, frame.X_WC, detection.centre, height)
        except ValueError:
            column, row = detection.centre
            raise NoDepth(
                f"the ray through pixel ({column:.0f}, {row:.0f}) of frame {frame.id} does not meet the "
                f"plane {height * 1000:.0f} mm above the table"
            ) from None

    def localize(self, detections: Detections) -> list[Observation]:
        """Return an observation of each found or doubtful detection, the doubtful ones first.

        A doubtful detection without a position is left out if at least one object was found.

        Raises:
            NoDepth: A detection cannot be localized.
        """
        found = [self._observe(detections, detection) for detection in detections.found]
        doubtful = []
        for detection in detections.doubtful:
            try:
                doubtful.append(self._observe(detections, detection, is_doubtful=True))
            except NoDepth:
                if not found:
                    raise
        return [*doubtful, *found]

    def _observe(
        self, detections: Detections, detection: Detection, *, is_doubtful: bool = False
    ) -> Observation:
        frame = detections.frame
        position = self.locate(detection, frame)
        std = detections.error_rates.jitter * frame.compute_depth(position) / float(frame.matrix[0, 0])
        contradiction = "" if is_doubtful else self._describe_contradiction(detections, detection, position)
        return Observation(detection, position, std, not (is_doubtful or contradiction), contradiction)

    def _describe_contradiction(self, detections: Detections, detection: Detection, position: Array) -> str:
        """Return how its box or its top contradicts a class, or ""; objects in bins lean and lie deep."""
        if any(bin.contains(position, BIN_THICKNESS) for bin in self.bins):
            return ""
        frame, area, kind = detections.frame, detections.area, self.classes[detection.label]
        return describe_wrong_size(detection, position, frame, area, kind) or describe_wrong_top(
            detection, position, frame, area, self.classes
        )


def build_localizer(
    method: Literal["plane", "depth", "ray"],
    classes: Mapping[str, ObjectClass],
    bins: Collection[Bin] = (),
    cast: Cast | None = None,
) -> CellLocalizer:
    """Return the localizer of a cell.

    Args:
        method: Method by which the height of an object is found.
        classes: Classes of the cell by label.
        bins: Bins of the cell; the class of an object in a bin is not checked.
        cast: Ray test of the simulator, for the method `ray`.
    """
    if method == "ray":
        assert cast is not None, "the method `ray` needs a simulator"
        return CellLocalizer(partial(_height_by_ray, cast), classes, bins)
    return CellLocalizer(_height_by_depth if method == "depth" else _height_on_table, classes, bins)


def _height_on_table(detection: Detection, frame: Frame, kind: ObjectClass) -> float:
    """Return half the height of the class [m]: the object stands on the table."""
    del detection, frame
    return kind.height / 2


def _height_by_depth(detection: Detection, frame: Frame, kind: ObjectClass) -> float:
    """Return the height of the centre [m] below the top that the depth image shows.

    The object may lie on another one.

    Raises:
        NoDepth: The frame has no depth image, or too little depth in the box.
    """
    return measure_top(detection, frame) - kind.height / 2


def _height_by_ray(cast: Cast, detection: Detection, frame: Frame, kind: ObjectClass) -> float:
    """Return the height of the centre [m] below the point that a ray of the simulator hits.

    Hardware has no such ray. The simulator casts it at the call and not at capture: an object may have moved
    since.

    Raises:
        NoDepth: The ray hits nothing.
    """
    hit = cast(frame.X_WC.position, compute_pixel_ray(frame.matrix, frame.X_WC, detection.centre))
    if hit is None:
        column, row = detection.centre
        raise NoDepth(f"the ray through pixel ({column:.0f}, {row:.0f}) of frame {frame.id} hits nothing")
    return float(hit[2]) - kind.height / 2
