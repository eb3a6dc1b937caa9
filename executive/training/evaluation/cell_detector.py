"""Detector of a cell file for single frames outside of a run."""

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
from executive.perception.detectors.detector_registry import build_detectors

REQUEST_INTERVAL = 1.0
"""Simulated time between two requests [s], similar to the time between two frames in a run."""
ANSWER_TIMEOUT = 60.0
"""Maximum simulated time from a request to its answer [s]."""
WHOLE_IMAGE_CAMERA = CameraConfig(
    mount="fixed", position=(0, 0, 1), look_at=(0, 0, 0), up=(1, 0, 0), fov_deg=60,
    table_view=(0, 0, 64, 64), scan_poses=("none",),
).model_copy(update={"table_view": (0, 0, 1 << 20, 1 << 20)})  # fmt: skip
"""Camera for images of any size; `model_copy` does not validate the size of `table_view`."""


class CellDetector:
    """Detector of a cell file for the evaluation of its accuracy.

    Args:
        configs: Detectors of the cell file by name; the evaluated detector may call other detectors.
        name: Name of the detector to evaluate.
        base: Folder to which paths in the options of detectors are relative.
        camera: Camera of the frames; None: the detector searches whole images.
        view: Searched view of `camera`, `table` or `full`.
        classes: Classes of the cell; detections of other classes are dropped, as in a run. None: all classes.

    Raises:
        InputError: A detector cannot be built.
    """

    def __init__(
        self,
        configs: Mapping[str, DetectorConfig], name: str, *, base: Path, camera: CameraConfig | None = None,
        view: str = "table", classes: Collection[str] | None = None,
    ) -> None:  # fmt: skip
        self.threshold = configs[name].threshold
        self._name = name
        self._view = view if camera else "full"
        self._classes = classes
        self._now = 0.0
        camera, clock = camera or WHOLE_IMAGE_CAMERA, StepClock(lambda: self._now)
        self._detectors = build_detectors(configs, camera=camera, clock=clock, base=base, seed=0)

    def detect(self, frame: Frame) -> tuple[Answer, float]:
        """Return the answer of the detector to a frame, and its latency in wall time [ms].

        Raises:
            Unavailable: The detector gave no usable answer.
        """
        start_time, request_time = time.perf_counter(), self._now
        try:
            request = self._detectors[self._name].request(replace(frame, stamp=request_time), self._view)
            while not request.ready:
                if self._now - request_time > ANSWER_TIMEOUT:
                    raise Unavailable(f"no answer within {ANSWER_TIMEOUT:g} s of simulated time")
                self._now += STEP
            answer = request.result()
        finally:
            self._now += REQUEST_INTERVAL
        latency = (time.perf_counter() - start_time) * 1000
        if self._classes is not None:
            detections = tuple(entry for entry in answer.confident if entry.label in self._classes)
            answer = replace(answer, confident=detections)
        return answer, latency

    def close(self) -> None:
        """Release the resources of the detectors."""
        for detector in self._detectors.values():
            detector.close()
