"""Detectors of a cell file outside of any run, asked as a run asks them."""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from executive.cell import Steps
from executive.cell_config import CameraConfig, DetectorConfig
from executive.errors import Unavailable
from executive.messages import Answer, Detection, Frame
from executive.vision.detectors.registry import build_detectors

STEP = 1 / 240
"""Length of a control step of simulated cells [s]."""
PAUSE = 1.0
"""Time on the clock between two looks [s]: about what lies between two in a run."""
TIMEOUT = 60.0
"""Longest time on the clock for an answer [s]."""
WHOLE_IMAGE = CameraConfig(
    mount="fixed", position=(0, 0, 1), look_at=(0, 0, 0), up=(1, 0, 0), fov_deg=60,
    table_view=(0, 0, 64, 64), scan_poses=("none",),
).model_copy(update={"table_view": (0, 0, 1 << 20, 1 << 20)})  # fmt: skip
"""A camera whose view `full` is searched in one piece, whatever the size of the image."""


@dataclass(frozen=True)
class Look:
    """Answer of a detector to one frame.

    Attributes:
        found: Everything at or above its floor, most confident first.
        threshold: Confidence from which it counts, for the detector that answered.
        answered_by: Name of that detector, "" where none gave a usable answer.
        latency: Wall time that it took [ms].
        why: Reason for which the detector was unavailable, or "".
    """

    found: tuple[Detection, ...]
    threshold: float
    answered_by: str
    latency: float
    why: str = ""


class ManualClock:
    """A run's clock that its owner advances; implements `executive.cell.Clock`."""

    def __init__(self) -> None:
        self.now = 0.0
        self.step = STEP

    def sleep(self, duration: float) -> Steps:
        """Yield until `duration` [s] has passed on this clock."""
        end = self.now + duration
        while self.now < end:
            yield


class CellDetector:
    """A detector of a cell file, built for measuring it.

    Args:
        configs: The detectors section of the cell file; a detector may need the others.
        name: Name of the detector that is asked.
        base: Folder that paths in their options start from.
        camera: The camera that the frames come from; with None every image is searched as a whole.
        view: The part of such frames that is searched.
        classes: Classes that the cell handles: as in a run, nothing else counts. None: everything counts.

    Raises:
        InputError: A detector cannot be built.
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
        self.threshold = configs[name].threshold
        self._name = name
        self._view = view if camera else "full"
        self._classes = classes
        self._clock = ManualClock()
        self._built = build_detectors(
            configs, camera=camera or WHOLE_IMAGE, clock=self._clock, base=base, seed=0
        )

    def ask(self, frame: Frame) -> Look:
        """Return the detector's answer to a frame, and the time it took."""
        stamped = replace(frame, stamp=self._clock.now)
        began = time.perf_counter()
        request = self._built[self._name].request(stamped, self._view)
        while not request.ready:
            if self._clock.now - stamped.stamp > TIMEOUT:
                return self._finish(began, why=f"no answer within {TIMEOUT:g} s of the clock")
            self._clock.now += STEP
        try:
            answer = request.result()
        except Unavailable as error:
            return self._finish(began, why=str(error))
        return self._finish(began, answer)

    def close(self) -> None:
        """Give back what the detectors hold."""
        for detector in self._built.values():
            detector.close()

    def _finish(self, began: float, answer: Answer | None = None, why: str = "") -> Look:
        latency = (time.perf_counter() - began) * 1000
        self._clock.now += PAUSE
        if answer is None:
            return Look((), self.threshold, "", latency, why)
        found = tuple(one for one in answer.found if self._classes is None or one.label in self._classes)
        return Look(found, answer.reliability.threshold, answer.detector, latency)
