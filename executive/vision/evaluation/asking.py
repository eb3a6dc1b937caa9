"""Asking a detector outside of any run, just as a run asks it."""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from executive.cell import Steps
from executive.cell_config import CameraConfig, DetectorConfig
from executive.clock import STEP
from executive.errors import Unavailable
from executive.messages import Detection, Frame
from executive.vision.detectors.registry import build_detectors
from executive.vision.detectors.setting import ClosableDetector

PAUSE = 1.0
"""Time on the clock between two looks [s]: about what lies between two in a run."""
PATIENCE = 60.0
"""Time on the clock after which no answer is waited for any more [s]."""


@dataclass(frozen=True)
class Look:
    """What a detector answered to one frame.

    Attributes:
        found: Everything at or above its floor, most confident first.
        threshold: Confidence from which it counts, for the detector that answered.
        answered_by: Name of that detector, "" where none gave a usable answer.
        latency: Wall time that it took [ms].
        why: What the detector said if it was unavailable, or "".
    """

    found: tuple[Detection, ...]
    threshold: float
    answered_by: str
    latency: float
    why: str = ""


class HandClock:
    """A run's clock that is advanced by hand; implements `executive.cell.Clock`."""

    def __init__(self) -> None:
        self.now = 0.0
        self.step = STEP

    def sleep(self, duration: float) -> Steps:
        """Yield until `duration` [s] has passed on this clock."""
        end = self.now + duration
        while self.now < end:
            yield

    def advance(self, duration: float = STEP) -> None:
        """Let time pass [s]."""
        self.now += duration


class CellDetector:
    """A detector of a cell file, built for measuring it.

    Args:
        configs: The detectors section of the cell file; a cascade needs the others.
        name: Which one is asked.
        base: Folder that paths in their options start from.
        camera: The camera that the frames come from; with None every image is searched as a whole.
        view: The part of such frames that is searched.
        classes: What the cell handles: as in a run, nothing else that is found counts. None: everything does.
    """

    def __init__(
        self,
        configs: Mapping[str, DetectorConfig],
        name: str,
        *,
        base: Path,
        camera: CameraConfig | None = None,
        view: str = "table",
        classes: Collection[str] | None = None,
    ) -> None:
        self._configs = configs
        self._name = name
        self._base = base
        self._camera = camera
        self._view = view
        self._classes = classes
        self._clock = HandClock()
        self._size: tuple[int, int] | None = None
        self._built: dict[str, ClosableDetector] = {}

    @property
    def threshold(self) -> float:
        """Confidence from which its detections count, as its section says."""
        return self._configs[self._name].threshold

    def ask(self, frame: Frame) -> Look:
        """Return what the detector says about a frame, and how long it took.

        Raises:
            InputError: The detector cannot be built.
        """
        height, width = frame.image.shape[:2]
        detector = self._detector((width, height))
        stamped = replace(frame, stamp=self._clock.now)
        began = time.perf_counter()
        request = detector.request(stamped, self._view)
        while not request.ready:
            if self._clock.now - stamped.stamp > PATIENCE:
                return self._unavailable(began, f"no answer within {PATIENCE:g} s of the clock")
            self._clock.advance()
        try:
            answer = request.result()
        except Unavailable as error:
            return self._unavailable(began, str(error))
        latency = (time.perf_counter() - began) * 1000
        self._clock.advance(PAUSE)
        found = tuple(one for one in answer.found if self._classes is None or one.label in self._classes)
        return Look(found, answer.reliability.threshold, answer.detector, latency)

    def close(self) -> None:
        """Give back what the detectors hold."""
        for detector in self._built.values():
            detector.close()
        self._built = {}

    def _unavailable(self, began: float, why: str) -> Look:
        self._clock.advance(PAUSE)
        return Look((), self.threshold, "", (time.perf_counter() - began) * 1000, why)

    def _detector(self, size: tuple[int, int]) -> ClosableDetector:
        """Return the detector, built anew where images of another size are searched as a whole."""
        if not self._built or (self._camera is None and size != self._size):
            self.close()
            self._size = size
            self._built = build_detectors(
                self._configs,
                camera=self._camera or whole_image(size),
                clock=self._clock,
                base=self._base,
                seed=0,
            )
        return self._built[self._name]


def whole_image(size: tuple[int, int]) -> CameraConfig:
    """Return a camera with images of this width and height [pixel], whose view `table` is all of them.

    A cell's own camera shows the table in a square; an image of a dataset need not be one.
    """
    camera = CameraConfig(
        mount="fixed", position=(0, 0, 1), look_at=(0, 0, 0), up=(1, 0, 0), fov_deg=60,
        table_view=(0, 0, 64, 64), scan_poses=("none",),
    )  # fmt: skip
    width, height = size
    return camera.model_copy(update={"width": width, "height": height, "table_view": (0, 0, width, height)})
