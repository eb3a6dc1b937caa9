"""Simulated cell with true detections, and access to the world of a fake or simulated cell.

A simulated sort takes about one second of computing time. Each frame contains its true detections, so that a
detector knows only the objects that are visible in its frame.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from executive.cell.config import CellConfig, DetectorConfig
from executive.cell.device_config import CameraConfig
from executive.cell.frame import Detection, Frame
from executive.cell.objects import UNKNOWN_LABEL
from executive.cell.protocols import Clock
from executive.cell.workcell import TrueObject, Workcell, find_innermost_cell
from executive.drivers.fake import FakeCell
from executive.drivers.sim.camera import Image, SimCamera
from executive.drivers.sim.cell import SimCell
from executive.drivers.sim.models import compute_bounding_box, load_mesh
from executive.drivers.sim.world import World
from executive.errors import InputError
from executive.geometry import Array, Pose
from executive.perception.camera_model import NEAR_PLANE, project
from executive.perception.detectors.requests import PendingSearch

ORACLE_CONFIDENCE = 0.9
"""Confidence of all detections of an oracle."""


class WorldAccess:
    """Access of tests to the true state of a fake or simulated world; skills have no such access.

    Attributes:
        cell: The parts of the fake or simulated cell, whose arm and tool have methods for tests.
        world: The `FakeWorld` or the simulated `World` of the cell.

    Raises:
        InputError: The cell is neither fake nor simulated.
    """

    def __init__(self, workcell: Workcell) -> None:
        inner: Any = find_innermost_cell(workcell)
        self.cell = inner.cell
        self._is_fake = isinstance(inner, FakeCell)
        self.world: Any = getattr(inner, "world" if self._is_fake else "_world", None)
        if self.world is None:
            raise InputError(f"tests can change only fake and simulated worlds, not a {type(inner).__name__}")

    @property
    def objects(self) -> Sequence[TrueObject]:
        """All loose objects, in the order of their creation."""
        if self._is_fake:
            return list(self.world.objects)
        return list(map(self.world.describe_object, self.world.labels))

    @property
    def held_object(self) -> TrueObject | None:
        """The object at the tool, or None."""
        held = self.world.held_object if self._is_fake else self.cell.tool.held_body
        return held if self._is_fake or held is None else self.world.describe_object(held)

    def find_nearest_object(
        self, position: Sequence[float] | Array, max_distance: float = math.inf
    ) -> TrueObject | None:
        """Return the nearest object within a horizontal distance [m]; none in a bin or in the tool counts."""
        held_object = self.held_object
        candidates = [
            true_object
            for true_object in self.objects
            if not any(bin.contains(true_object.position) for bin in self.cell.bins.values())
            and (held_object is None or true_object.body != held_object.body)
            and math.dist(true_object.position[:2], position[:2]) <= max_distance
        ]
        return min(candidates, key=lambda each: math.dist(each.position[:2], position[:2]), default=None)

    def is_free(self, position: Array, moved_object: TrueObject) -> bool:
        """Return True if `moved_object` would touch no other object at a horizontal `position` [m]."""
        classes = self.cell.classes
        radius = classes[moved_object.label].radius
        return all(
            math.dist(position, other.position[:2]) - classes[other.label].radius > radius
            for other in self.objects
            if other.body != moved_object.body
        )

    def remove(self, true_object: TrueObject) -> None:
        """Remove an object from the world; a held object is released first."""
        self.release(true_object)
        if self._is_fake:
            self.world.remove(true_object)
        else:
            self.world.remove_object(true_object.body)

    def move(self, true_object: TrueObject, displacement: tuple[float, float]) -> None:
        """Displace an object by `(x, y)` [m]; a held object is released first."""
        self.release(true_object)
        if self._is_fake:
            true_object.position[:2] += displacement
            true_object.rest_positions.append(true_object.position.copy())
        else:
            X_WO = self.world.get_object_pose(true_object.body)
            position = X_WO.position + np.array([*displacement, 0.0])
            self.world.place_object(true_object.body, Pose(X_WO.rotation, position))

    def release(self, true_object: TrueObject) -> None:
        """Let an object fall if the tool holds it."""
        if self.held_object is not None and self.held_object.body == true_object.body:
            self.cell.tool.lose_grip()


@dataclass(frozen=True, eq=False)
class TrueFrame(Frame):
    """A frame with ground truth: the true detections of its objects.

    Attributes:
        true_detections: Detections of all objects with a class whose box centre no other object occludes.
    """

    true_detections: tuple[Detection, ...]


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
    """A simulated camera whose frames contain ground truth: the true detections.

    Images are black unless `renders_images` is True or the camera measures depth.
    """

    def __init__(self, world: World, *args: Any, renders_images: bool = False, **options: Any) -> None:
        super().__init__(world, *args, **options)
        self._renders_images = renders_images

    def capture(self) -> TrueFrame:
        """Capture an image and return the frame with its true detections."""
        return TrueFrame(**vars(super().capture()), true_detections=self._find_true_detections())

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
            Detection(outline.label, ORACLE_CONFIDENCE, compute_bounding_box(outline.pixels))
            for outline in outlines
            if outline.label != UNKNOWN_LABEL and not any(other.is_occluding(outline) for other in outlines)
        )


@dataclass(frozen=True, eq=False)
class Oracle:
    """A detector that returns the true detections of a `TrueFrame`; implements `cell.protocols.Detector`.

    The detector omits boxes whose centre is outside the requested view or occluded by the arm.

    Attributes:
        name: Name of the detector in the cell file.
        config: Section of the detector in the cell file; only threshold, error rates and latency are used.
        camera: Camera of the frames.
        clock: Clock of the run.
        box_std: Standard deviation of the noise of each box coordinate [pixel].
        seed: Random seed of the noise; each frame has its own noise.
    """

    name: str
    config: DetectorConfig
    camera: CameraConfig
    clock: Clock
    box_std: float
    seed: int

    def request(self, frame: Frame, view: str) -> PendingSearch:
        """Request the true detections of `frame`, which are available after the latency of the detector."""
        assert isinstance(frame, TrueFrame), "an oracle requires frames of a TruthCamera"
        random_generator = np.random.default_rng([self.seed, frame.id])
        detections = []
        for true_detection in frame.true_detections:
            box = np.array(true_detection.box) + random_generator.normal(0.0, self.box_std, 4)
            detection = replace(true_detection, box=(box[0], box[1], box[2], box[3]))
            column, row = detection.centre
            left, top, right, bottom = self.camera.get_view_box(view)
            if left <= column < right and top <= row < bottom and frame.visible[int(row), int(column)]:
                detections.append(detection)
        answer: Future[list[Detection]] = Future()
        answer.set_result(detections)
        answer_time = self.clock.now + self.config.latency
        return PendingSearch(answer, answer_time, self.clock, self.name, self.config.error_rates)

    def close(self) -> None:
        """Do nothing: an oracle holds no resources."""


def make_oracle_kind(*, box_std: float = 0.7, renders_images: bool = False) -> Callable[..., SimCell]:
    """Return a factory of simulated cells with oracles as detectors, for `RunOptions.make_cell`.

    `box_std`: standard deviation of box coordinates [pixel]; if `renders_images` is False, images are black.
    """
    camera = partial(TruthCamera, renders_images=renders_images)
    return partial(SimCell, build_camera=camera, build_detectors=partial(_build_oracles, box_std=box_std))


def _build_oracles(
    config: CellConfig, *, clock: Clock, base: Path, seed: int, folders: Sequence[Path], box_std: float
) -> dict[str, Oracle]:
    del base, folders  # An oracle loads no files from the folder of the cell file.
    camera = next(iter(config.cameras.values()))
    return {
        name: Oracle(name, detector_config, camera, clock, box_std, seed)
        for name, detector_config in config.detectors.items()
    }
