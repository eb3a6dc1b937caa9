"""The fake cell's camera and detectors: blank images, and detectors that know what they would show."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from executive.cell.config import CameraConfig, DetectorConfig, TableConfig
from executive.cell.detection import Answer, Detection
from executive.cell.error_rates import ErrorRates
from executive.cell.frame import Box, Frame
from executive.cell.protocols import Clock, Request
from executive.cells.fake.world import FakeWorld
from executive.errors import Unavailable
from executive.geometry import Pose
from executive.perception.mounted_camera import MountedCamera

MIN_CONFIDENCE = 0.9
"""What a fake detector says of what it sees, or its threshold where that is more."""


class FakeCamera(MountedCamera):
    """A camera where the cell file says, whose images are blank.

    Attributes:
        sees: Tells whether the whole workspace is in view; the fake arm hides nothing.
        hides: Parts of the image [pixel] that a test wants hidden.
        displaced: Displacement in words that a test wants its frames to show.
    """

    def __init__(
        self,
        name: str,
        config: CameraConfig,
        table: TableConfig,
        flange: Callable[[], Pose],
        clock: Clock,
        epoch: Callable[[], int],
    ) -> None:
        super().__init__(name, config, flange, clock, epoch)
        self.sees: Callable[[], bool] = self._whole_table
        self.hides: list[Box] = []
        self.displaced = ""
        self._corners = np.array([(x, y, 0.0) for x in table.x for y in table.y])

    def sees_table(self) -> bool:
        """Tell what `sees` says."""
        return self.sees()

    def displacement(self, frame: Frame) -> str:
        """Return the text of `displaced`."""
        del frame
        return self.displaced

    def _sense(self) -> tuple[NDArray[np.uint8], None]:
        return np.zeros((self.config.height, self.config.width, 3), dtype=np.uint8), None

    def _find_visible(self, X_WC: Pose) -> NDArray[np.bool_]:
        del X_WC
        visible = np.ones((self.config.height, self.config.width), dtype=bool)
        for left, top, right, bottom in self.hides:
            visible[int(top) : int(bottom), int(left) : int(right)] = False
        return visible

    def _whole_table(self) -> bool:
        corners = self._pose().inverse().apply(self._corners) @ self.matrix.T
        pixels = corners[:, :2] / corners[:, 2:]
        inside = (pixels >= 0) & (pixels < (self.config.width, self.config.height))
        return bool(np.all(corners[:, 2] > 0) and np.all(inside))


@dataclass(frozen=True)
class FakeRequest:
    """An answer that is due at a time."""

    due: float
    clock: Clock
    answer: Sequence[Detection] | str
    detector: str
    error_rates: ErrorRates

    @property
    def ready(self) -> bool:
        """True once the time has come."""
        return self.clock.now >= self.due

    def result(self) -> Answer:
        """Return the detections, or raise Unavailable with the sentence scripted."""
        if isinstance(self.answer, str):
            raise Unavailable(self.answer)
        return Answer(self.detector, tuple(self.answer), self.error_rates)


def _truthful(look: int, true: Sequence[Detection]) -> Sequence[Detection]:
    del look
    return true


@dataclass(eq=False)
class FakeDetector:
    """A detector that sees every object before the lens, unless `answers` says otherwise for a look.

    Attributes:
        name: Its name in the cell file.
        config: Its section of the cell file.
        world: What it sees.
        clock: The run's clock.
        area: Returns the part of the image [pixel] that a view means.
        answers: Gets the number of the look (from 1) and the true detections, and returns detections, or a
            sentence to be unavailable with.
        looks: Looks so far.
    """

    name: str
    config: DetectorConfig
    world: FakeWorld
    clock: Clock
    area: Callable[[str], Box]
    answers: Callable[[int, Sequence[Detection]], Sequence[Detection] | str] = _truthful
    looks: int = 0

    def request(self, frame: Frame, view: str) -> Request:
        """Answer with what the searched part of the frame would show, as late as the cell file says."""
        self.looks += 1
        left, top, right, bottom = self.area(view)
        true = []
        for thing in self.world.objects:
            x, y, depth = frame.matrix @ frame.X_WC.inverse().apply(thing.position)
            if depth <= 0 or thing is self.world.held:
                continue
            column, row = x / depth, y / depth
            if left <= column < right and top <= row < bottom:
                true.append(self._detection(thing.label, column, row, frame.matrix[0, 0] / depth))
        return FakeRequest(
            self.clock.now + self.config.latency,
            self.clock,
            self.answers(self.looks, true),
            self.name,
            self.config.error_rates,
        )

    def close(self) -> None:
        """Have nothing to give back."""

    def _detection(self, label: str, column: float, row: float, scale: float) -> Detection:
        """Return the box around an object whose centre is at a pixel, at a `scale` [pixel/m]."""
        size = scale * self.world.classes[label].radius
        box = (column - size, row - size, column + size, row + size)
        return Detection(label, max(MIN_CONFIDENCE, self.config.threshold), box)
