"""Simulated cell with true detections: physics and motion are simulated, detections are the true boxes.

A whole simulated sort takes about a second of computing time, without errors of a network. Each frame carries
its true detections, so that a detector knows no more than its frame shows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from executive.cell.config import CameraConfig, CellConfig, DetectorConfig
from executive.cell.detection import Detection
from executive.cell.frame import Frame
from executive.cell.protocols import Clock
from executive.cells.audit import UNKNOWN
from executive.cells.sim.camera import Image, SimCamera
from executive.cells.sim.cell import SimCell
from executive.cells.sim.models import load_mesh
from executive.cells.sim.silhouette import outline_box
from executive.cells.sim.world import World
from executive.geometry import Array
from executive.perception.camera_model import NEAR, project
from executive.perception.detectors.requests import Pending

CONFIDENCE = 0.9
"""Confidence of all detections of an oracle."""


@dataclass(frozen=True, eq=False)
class TrueFrame(Frame):
    """A frame with its true detections.

    Attributes:
        truth: Boxes around the outlines of the loose objects before the lens; an object whose centre is
            hidden by another one is missing.
    """

    truth: tuple[Detection, ...]


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

    def is_hiding(self, other: _Outline) -> bool:
        """Return True if this object is nearer than another one and covers the centre of the other box."""
        left, top, right, bottom = outline_box(other.pixels)
        hull = cv2.convexHull(self.pixels.astype(np.float32))
        centre = ((left + right) / 2, (top + bottom) / 2)
        return self.distance < other.distance and cv2.pointPolygonTest(hull, centre, False) > 0


class TruthCamera(SimCamera):
    """A simulated camera whose frames carry true detections; images are black without `rendered` or depth."""

    def __init__(self, world: World, *args: Any, rendered: bool = False, **options: Any) -> None:
        super().__init__(world, *args, **options)
        self._rendered = rendered

    def capture(self) -> TrueFrame:
        """Return a new frame with its true detections."""
        frame = super().capture()
        return TrueFrame(**vars(frame), truth=self._find_true_detections())

    def _capture_images(self) -> tuple[Image, Array | None]:
        if self._rendered or self.config.depth:
            return super()._capture_images()
        return np.zeros((self.config.height, self.config.width, 3), np.uint8), None

    def _find_true_detections(self) -> tuple[Detection, ...]:
        outlines = []
        matrix, X_WC = self._true_view()
        for body, label in self._world.bodies.items():
            mesh = load_mesh(self._world.models[body])
            outline = self._world.object_pose(body).apply(mesh.vertices)
            distances = X_WC.inverse().apply(outline)[:, 2]
            if np.all(distances > NEAR):
                pixels = project(matrix, X_WC, outline)
                outlines.append(_Outline(label, pixels, float(distances.mean())))
        return tuple(
            Detection(outline.label, CONFIDENCE, outline_box(outline.pixels))
            for outline in outlines
            if outline.label != UNKNOWN and not any(other.is_hiding(outline) for other in outlines)
        )


@dataclass(frozen=True, eq=False)
class Oracle:
    """A detector that answers with the truth of a `TrueFrame`; implements `cell.protocols.Detector`.

    It reports the boxes whose centre is in the searched part of the image and not hidden by the arm.

    Attributes:
        name: Name of the detector in the cell file.
        config: Threshold and latency of the detector; the kind is ignored.
        camera: Camera of the frames.
        clock: Clock of the run.
        jitter: Standard deviation of each side of a box [pixel].
        seed: Random seed of the jitter, together with the number of the frame.
    """

    name: str
    config: DetectorConfig
    camera: CameraConfig
    clock: Clock
    jitter: float
    seed: int

    def request(self, frame: Frame, view: str) -> Pending:
        """Request the true detections of `frame`, which are available after the latency of the detector."""
        assert isinstance(frame, TrueFrame), "an oracle needs the frames of a TruthCamera"
        random = np.random.default_rng([self.seed, frame.id])
        found = []
        for true in frame.truth:
            box = np.array(true.box) + random.normal(0.0, self.jitter, 4)
            seen = Detection(true.label, true.confidence, (box[0], box[1], box[2], box[3]))
            column, row = seen.centre
            left, top, right, bottom = self.camera.area(view)
            if left <= column < right and top <= row < bottom and frame.visible[int(row), int(column)]:
                found.append(seen)
        answer: Future[list[Detection]] = Future()
        answer.set_result(found)
        due = self.clock.now + self.config.latency
        return Pending(answer, due, self.clock, self.name, self.config.error_rates)

    def close(self) -> None:
        """Do nothing: an oracle holds no resources."""


def oracle_cell(*, jitter: float = 0.7, rendered: bool = False) -> Callable[..., SimCell]:
    """Return a kind of cell for `RunOptions.kind`: a simulated cell with oracles as detectors.

    Args:
        jitter: Standard deviation of each side of a box [pixel].
        rendered: True to render the images of the camera; otherwise they are black.
    """
    camera = partial(TruthCamera, rendered=rendered)
    return partial(SimCell, camera=camera, detectors=partial(_build_oracles, jitter=jitter))


def _build_oracles(
    config: CellConfig, *, clock: Clock, base: Path, seed: int, folders: Sequence[Path], jitter: float
) -> dict[str, Oracle]:
    del base, folders
    camera = next(iter(config.cameras.values()))
    return {
        name: Oracle(name, section, camera, clock, jitter, seed) for name, section in config.detectors.items()
    }
