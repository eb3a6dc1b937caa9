"""Simulated cell with true detections, and access to the world of a fake or simulated cell.

A simulated sort takes about one second of computing time. Each frame contains its true detections, so that a
detector knows only the objects that are visible in its frame.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import cv2
import numpy as np

from executive.cell.config import CellConfig
from executive.cell.devices import CameraImage, DriverOptions, TrueObject, TrueWorld
from executive.cell.frame import Detection
from executive.cell.objects import UNKNOWN_LABEL
from executive.drivers.sim.camera import Image, SimCamera
from executive.drivers.sim.driver import SimDriver
from executive.drivers.sim.models import compute_bounding_box, load_mesh
from executive.drivers.sim.world import World
from executive.errors import InputError
from executive.geometry import Array
from executive.perception.camera_model import NEAR_PLANE, project
from executive.perception.detectors.cell_detector import TruthDetector
from executive.station.station import Station


class WorldAccess:
    """Access of tests to the true state of a fake or simulated world; skills have no such access.

    Attributes:
        station: The station of the world.
        driver: The devices of the station.

    Raises:
        InputError: The world of the driver is not known.
    """

    def __init__(self, station: Station) -> None:
        self.station = station
        driver: Any = station.driver
        if not isinstance(driver, TrueWorld):
            raise InputError(
                f"tests can change only known worlds, not the world of a {type(driver).__name__}"
            )
        self.driver = driver

    @property
    def objects(self) -> Sequence[TrueObject]:
        """All loose objects, in the order of their creation."""
        return self.driver.list_objects()

    @property
    def held_object(self) -> TrueObject | None:
        """The object at the tool, or None."""
        return self.driver.find_held_object()

    def find_nearest_object(
        self, position: Sequence[float] | Array, max_distance: float = math.inf
    ) -> TrueObject | None:
        """Return the nearest object within a horizontal distance [m]; none in a bin or in the tool counts."""
        held_object = self.held_object
        candidates = [
            true_object
            for true_object in self.objects
            if not any(bin.contains(true_object.position) for bin in self.station.cell.bins.values())
            and (held_object is None or true_object.body != held_object.body)
            and math.dist(true_object.position[:2], position[:2]) <= max_distance
        ]
        return min(candidates, key=lambda each: math.dist(each.position[:2], position[:2]), default=None)

    def is_free(self, position: Array, moved_object: TrueObject) -> bool:
        """Return True if `moved_object` would touch no other object at a horizontal `position` [m]."""
        classes = self.station.cell.classes
        radius = classes[moved_object.label].radius
        return all(
            math.dist(position, other.position[:2]) - classes[other.label].radius > radius
            for other in self.objects
            if other.body != moved_object.body
        )

    def remove(self, true_object: TrueObject) -> None:
        """Remove an object from the world; a held object is released first."""
        self.release(true_object)
        self.driver.remove_object(true_object)

    def move(self, true_object: TrueObject, displacement: tuple[float, float]) -> None:
        """Displace an object by `(x, y)` [m]; a held object is released first."""
        self.release(true_object)
        self.driver.move_object(true_object, displacement)

    def release(self, true_object: TrueObject) -> None:
        """Let the tool lose an object if it holds the object."""
        if self.held_object is not None and self.held_object.body == true_object.body:
            self.driver.drop_held_object()


@dataclass(frozen=True, eq=False)
class _Outline:
    """Outline of an object in an image.

    Attributes:
        label: Class of the object.
        pixels: Projected vertices `(N, 2)` [pixel].
        distance: Mean distance of the vertices from the camera along the optical axis [m].
    """

    label: str
    pixels: Array
    distance: float

    def is_occluding(self, other: _Outline) -> bool:
        """Return True if this object is nearer than `other` and occludes the centre of the box of `other`."""
        left, top, right, bottom = compute_bounding_box(other.pixels)
        hull = cv2.convexHull(self.pixels.astype(np.float32))
        centre = ((left + right) / 2, (top + bottom) / 2)
        return self.distance < other.distance and cv2.pointPolygonTest(hull, centre, False) > 0


class TruthCamera(SimCamera):
    """A simulated camera whose frames contain the true detections: no other object occludes their centres.

    Images are black unless `renders_images` is True or the camera measures depth.
    """

    def __init__(self, world: World, *args: Any, renders_images: bool = False, **options: Any) -> None:
        super().__init__(world, *args, **options)
        self._renders_images = renders_images

    def capture(self) -> CameraImage:
        """Capture and return an image with its true detections."""
        return super().capture()._replace(true_detections=self._find_true_detections())

    def _capture_images(self) -> tuple[Image, Array | None]:
        if self._renders_images or self.config.depth:
            return super()._capture_images()
        return np.zeros((self.config.height, self.config.width, 3), np.uint8), None

    def _find_true_detections(self) -> tuple[Detection, ...]:
        outlines = []
        camera_matrix, X_WC = self.get_true_view()
        for body, label in self._world.labels.items():
            vertices = self._world.get_object_pose(body).apply(load_mesh(self._world.models[body]).vertices)
            distances = X_WC.inverse().apply(vertices)[:, 2]
            if np.all(distances > NEAR_PLANE):
                pixels = project(camera_matrix, X_WC, vertices)
                outlines.append(_Outline(label, pixels, float(distances.mean())))
        return tuple(
            self._make_detection(outline)
            for outline in outlines
            if outline.label != UNKNOWN_LABEL and not any(other.is_occluding(outline) for other in outlines)
        )

    def _make_detection(self, outline: _Outline) -> Detection:
        """Return the true detection of an object; with its convex outline if the cell needs the yaw."""
        detection = Detection(outline.label, 1.0, compute_bounding_box(outline.pixels))
        if not self._world.config.needs_yaw:
            return detection
        hull = cv2.convexHull(outline.pixels.astype(np.float32)).reshape(-1, 2)
        return replace(detection, outline=tuple((x, y) for x, y in hull.tolist()))


@dataclass(frozen=True)
class OracleKind:
    """Kind of simulated drivers whose images contain true detections; implements `DriverKind`.

    Attributes:
        renders_images: True to render images; otherwise images are black unless the camera measures depth.
    """

    renders_images: bool = False
    check = staticmethod(SimDriver.check)
    compute_mass = staticmethod(SimDriver.compute_mass)

    def __call__(self, config: CellConfig, options: DriverOptions) -> SimDriver:
        """Return the driver of a cell."""
        return SimDriver(config, options, partial(TruthCamera, renders_images=self.renders_images))


def make_oracle_kind(*, box_std: float = 0.7, renders_images: bool = False) -> Callable[..., Station]:
    """Return a factory of simulated stations with true detections, for `RunOptions.make_cell`.

    `box_std`: standard deviation of box coordinates [pixel]; if `renders_images` is False, images are black.
    """
    make_detector = partial(TruthDetector.from_config, box_std=box_std)
    return partial(Station, kind=OracleKind(renders_images), make_detector=make_detector)
