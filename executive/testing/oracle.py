"""A simulated cell that knows instead of seeing: real physics and motion, detections from the truth.

A whole simulated sort costs about a second of computing this way, and never fails for what a network
took for a duck. The truth goes with the frame, as an image does, so nothing knows more than its look.
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
"""What an oracle says of everything it sees."""


@dataclass(frozen=True, eq=False)
class TrueFrame(Frame):
    """A frame that says what it shows.

    Attributes:
        truth: The box around the outline of every loose object before the lens whose middle no other hides.
    """

    truth: tuple[Detection, ...]


@dataclass(frozen=True, eq=False)
class _Outline:
    """An object in an image: its vertices `(N, 2)` [pixel] and how far it is from the camera [m]."""

    label: str
    pixels: Array
    distance: float

    def hides(self, other: _Outline) -> bool:
        """Tell whether this one is before the middle of the other."""
        left, top, right, bottom = outline_box(other.pixels)
        hull = cv2.convexHull(self.pixels.astype(np.float32))
        middle = ((left + right) / 2, (top + bottom) / 2)
        return self.distance < other.distance and cv2.pointPolygonTest(hull, middle, False) > 0


class TruthCamera(SimCamera):
    """A simulated camera whose frames carry the truth; without depth they are black unless `rendered`."""

    def __init__(self, world: World, *args: Any, rendered: bool = False, **options: Any) -> None:
        super().__init__(world, *args, **options)
        self._rendered = rendered

    def capture(self) -> TrueFrame:
        """Return a fresh frame of what the camera sees now, and the truth about it."""
        frame = super().capture()
        return TrueFrame(**vars(frame), truth=self._truth())

    def _sense(self) -> tuple[Image, Array | None]:
        if self._rendered or self.config.depth:
            return super()._sense()
        return np.zeros((self.config.height, self.config.width, 3), np.uint8), None

    def _truth(self) -> tuple[Detection, ...]:
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
            if outline.label != UNKNOWN and not any(other.hides(outline) for other in outlines)
        )


@dataclass(frozen=True, eq=False)
class Oracle:
    """A detector that answers with the truth of a `TrueFrame`; implements `cell.protocols.Detector`.

    It reports what has the centre of its box in the searched part of the image and not behind the arm.

    Attributes:
        name: Its name in the cell file.
        config: Its threshold and latency count; its kind does not.
        camera: The camera whose frames it searches.
        clock: The run's clock.
        jitter: Standard deviation of each side of a box [pixel].
        seed: Decides the jitter, together with the number of the frame.
    """

    name: str
    config: DetectorConfig
    camera: CameraConfig
    clock: Clock
    jitter: float
    seed: int

    def request(self, frame: Frame, view: str) -> Pending:
        """Return the truth about `frame`, visible as late as a real detector's answer."""
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
        """Have nothing to give back."""


def oracle_cell(*, jitter: float = 0.7, rendered: bool = False) -> Callable[..., SimCell]:
    """Return a kind of cell, for `RunOptions.kind`: the simulated one with oracles for detectors.

    Args:
        jitter: Standard deviation of each side of a box [pixel].
        rendered: Draw the camera's images, for whoever looks at them.
    """
    camera = partial(TruthCamera, rendered=rendered)
    return partial(SimCell, camera=camera, detectors=partial(_oracles, jitter=jitter))


def _oracles(
    config: CellConfig, *, clock: Clock, base: Path, seed: int, folders: Sequence[Path], jitter: float
) -> dict[str, Oracle]:
    del base, folders
    camera = next(iter(config.cameras.values()))
    return {
        name: Oracle(name, section, camera, clock, jitter, seed) for name, section in config.detectors.items()
    }
