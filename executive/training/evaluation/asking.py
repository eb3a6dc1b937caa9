"""Detectors of a cell file outside of any run, asked as a run asks them."""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path

from executive.cell.clock import STEP, StepClock
from executive.cell.config import CameraConfig, DetectorConfig
from executive.cell.detection import Answer
from executive.cell.frame import Frame
from executive.errors import Unavailable
from executive.perception.detectors.registry import build_detectors

PAUSE = 1.0
"""Time on the clock between two looks [s]: about what lies between two in a run."""
TIMEOUT = 60.0
"""Longest time on the clock for an answer [s]."""
WHOLE_IMAGE = CameraConfig(
    mount="fixed", position=(0, 0, 1), look_at=(0, 0, 0), up=(1, 0, 0), fov_deg=60,
    table_view=(0, 0, 64, 64), scan_poses=("none",),
).model_copy(update={"table_view": (0, 0, 1 << 20, 1 << 20)})  # fmt: skip
"""A camera whose view `full` is searched in one piece, whatever the size of the image."""


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
        self._now = 0.0
        clock = StepClock(lambda: self._now)
        self._built = build_detectors(configs, camera=camera or WHOLE_IMAGE, clock=clock, base=base, seed=0)

    def ask(self, frame: Frame) -> tuple[Answer, float]:
        """Return the detector's answer to a frame, and the wall time that it took [ms].

        Raises:
            Unavailable: The detector gave no usable answer.
        """
        began, asked = time.perf_counter(), self._now
        try:
            request = self._built[self._name].request(replace(frame, stamp=asked), self._view)
            while not request.ready:
                if self._now - asked > TIMEOUT:
                    raise Unavailable(f"no answer within {TIMEOUT:g} s of the clock")
                self._now += STEP
            answer = request.result()
        finally:
            self._now += PAUSE
        latency = (time.perf_counter() - began) * 1000
        found = tuple(one for one in answer.found if self._classes is None or one.label in self._classes)
        return replace(answer, found=found), latency

    def close(self) -> None:
        """Give back what the detectors hold."""
        for detector in self._built.values():
            detector.close()
