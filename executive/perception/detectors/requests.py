"""Searches of frames in another thread, whose answers become visible at a time of the run."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from executive.cell.config import DetectorConfig
from executive.cell.detection import Answer, Detection
from executive.cell.error_rates import ErrorRates
from executive.cell.frame import Frame
from executive.cell.protocols import Clock, Request
from executive.errors import DeadlinePassed, Unavailable
from executive.perception.detectors.setting import DetectorSetting
from executive.perception.detectors.views import Part, list_parts

MAX_BLOCKING_TIME = 0.05
"""Longest uninterrupted wait for an overdue answer [s]; a second Ctrl-C ends the wait."""
CLOCK_ROUNDING_ERROR = 1e-9
"""Rounding error allowed in comparisons of two times on the clock [s]."""


@dataclass(frozen=True, eq=False)
class ChangedRequest:
    """Request whose answer is changed before it is returned; implements `executive.cell.protocols.Request`.

    Attributes:
        request: The request.
        change: Takes the answer and returns the changed one.
        detector: Name of the detector, which is put before the text of an error; "" for no change.
    """

    request: Request
    change: Callable[[Answer], Answer]
    detector: str = ""

    @property
    def ready(self) -> bool:
        """True if the answer is available."""
        return self.request.ready

    def result(self) -> Answer:
        """Return the changed answer.

        Raises:
            Unavailable: The detector gave no usable answer.
        """
        try:
            answer = self.request.result()
        except Unavailable as error:
            if not self.detector:
                raise
            raise Unavailable(f"detector {self.detector}: {error}") from error
        return self.change(answer)


@dataclass(eq=False)
class Pending:
    """Search in progress; implements `executive.cell.protocols.Request`.

    Attributes:
        work: Future detections of the thread.
        due: Time from which the answer is visible [s].
        clock: Clock of the run.
        detector: Name of the detector.
        error_rates: Error rates of the detector.
        expiry: Time from which a missed deadline is visible [s].
    """

    work: Future[list[Detection]]
    due: float
    clock: Clock
    detector: str
    error_rates: ErrorRates
    expiry: float = -math.inf

    @property
    def ready(self) -> bool:
        """True from the control step at which the answer is due.

        At that control step the property waits for the thread, so that the time at which an answer becomes
        visible does not depend on the computer's speed. A missed deadline is visible from `expiry`.
        """
        if self.clock.now < self.due - CLOCK_ROUNDING_ERROR:
            return False
        while not self.work.done():
            wait([self.work], MAX_BLOCKING_TIME)
        is_late = isinstance(self.work.exception(), DeadlinePassed)
        return not is_late or self.clock.now >= self.expiry - CLOCK_ROUNDING_ERROR

    def result(self) -> Answer:
        """Return the answer of the detector.

        Raises:
            Unavailable: The detector gave no usable answer.
        """
        if not self.ready:
            raise RuntimeError(
                f"the answer is due at {self.due:.3f} s, and the time is {self.clock.now:.3f} s; "
                "wait until `ready` is true"
            )
        return Answer(self.detector, tuple(self.work.result()), self.error_rates)


class ThreadedDetector:
    """Detector that searches in its own thread, beside the control loop; base of `ClosableDetector`s.

    Args:
        config: Threshold, floor and latency.
        setting: Parts of the run that the detector needs.
        deadline: Time from a request until a missed deadline is visible [s].
    """

    def __init__(self, config: DetectorConfig, setting: DetectorSetting, deadline: float = -math.inf) -> None:
        self._config, self._setting, self._deadline = config, setting, deadline
        self._thread = ThreadPoolExecutor(1, f"detector-{setting.name}")

    def request(self, frame: Frame, view: str) -> Pending:
        """Start a search of the `table` part of a frame or of the `full` image."""
        parts = self._parts(view, frame.image.shape[1::-1])
        work = self._thread.submit(lambda: self._search(frame.image, parts))
        clock, config = self._setting.clock, self._config
        due, expiry = clock.now + config.latency, clock.now + self._deadline
        return Pending(work, due, clock, self._setting.name, config.error_rates, expiry)

    def close(self) -> None:
        """End the thread after the search in progress; waiting searches are cancelled."""
        self._thread.shutdown(cancel_futures=True)

    def _parts(self, view: str, size: tuple[int, ...]) -> list[Part]:
        """Return the parts of a frame to search, for a view and the width and height of the frame [pixel]."""
        return list_parts(view, self._setting.camera.table_view, (size[0], size[1]))

    def _search(self, image: NDArray[np.uint8], parts: Sequence[Part]) -> list[Detection]:
        """Return the objects in the parts of a frame, most confident first; runs in the thread."""
        raise NotImplementedError
