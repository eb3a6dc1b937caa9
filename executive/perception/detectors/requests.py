"""Detections under way: worked on by another thread, visible on the run's clock."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, TimeoutError
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
from executive.perception.detectors.views import Part, parts_of

MAX_BLOCKING_TIME = 0.05
"""Longest time the caller is held at once while an answer is overdue [s]; a second Ctrl-C ends it."""
CLOCK_ROUNDING_ERROR = 1e-9
"""Rounding allowed when two times on the clock are compared [s]."""


@dataclass(frozen=True, eq=False)
class ChangedRequest:
    """A request whose answer is changed before it is read; implements `executive.cell.protocols.Request`.

    Attributes:
        request: The request.
        change: Returns the answer that is read instead.
        detector: Name of the detector, with which the text of an error begins; "": the text is not changed.
    """

    request: Request
    change: Callable[[Answer], Answer]
    detector: str = ""

    @property
    def ready(self) -> bool:
        """True once the answer can be read."""
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
    """A detection under way; implements `executive.cell.protocols.Request`.

    Attributes:
        work: What the worker will leave.
        due: Time on the run's clock from which the answer is visible [s].
        clock: The run's clock.
        detector: Name of the detector.
        error_rates: Error rates of that detector.
        given_up: Time on the run's clock at which it shows that a deadline has passed [s].
    """

    work: Future[list[Detection]]
    due: float
    clock: Clock
    detector: str
    error_rates: ErrorRates
    given_up: float = -math.inf

    @property
    def ready(self) -> bool:
        """True from the tick at which the answer is due.

        At that tick the caller waits for a worker that is not done yet, so that the tick at which an
        answer becomes visible does not depend on the computer's speed. That a deadline has passed shows
        when it has passed on the run's clock too.
        """
        if self.clock.now < self.due - CLOCK_ROUNDING_ERROR:
            return False
        while not self.work.done():
            try:
                self.work.exception(MAX_BLOCKING_TIME)
            except TimeoutError:
                continue
        expired = isinstance(self.work.exception(), DeadlinePassed)
        return not expired or self.clock.now >= self.given_up - CLOCK_ROUNDING_ERROR

    def result(self) -> Answer:
        """Return what the detector says.

        Raises:
            Unavailable: The detector gave no usable answer.
        """
        if not self.ready:
            raise RuntimeError(
                f"the detection is due at {self.due:.3f} s and it is {self.clock.now:.3f} s; "
                "wait until `ready` is true"
            )
        return Answer(self.detector, tuple(self.work.result()), self.error_rates)


class ThreadedDetector:
    """Detector that searches in a thread of its own, beside the tick loop; base of `ClosableDetector`s.

    Args:
        config: Threshold, floor and latency.
        setting: Parts of the run that the detector needs.
        deadline: Time after which a passed deadline shows on the run's clock [s].
    """

    def __init__(self, config: DetectorConfig, setting: DetectorSetting, deadline: float = -math.inf) -> None:
        self._config, self._setting, self._deadline = config, setting, deadline
        self._thread = ThreadPoolExecutor(1, f"detector-{setting.name}")

    def request(self, frame: Frame, view: str) -> Pending:
        """Start to search `frame`: the `table` part or the `full` image."""
        parts = self._parts(view, frame.image.shape[1::-1])
        work = self._thread.submit(lambda: self._search(frame.image, parts))
        clock, config = self._setting.clock, self._config
        due, given_up = clock.now + config.latency, clock.now + self._deadline
        return Pending(work, due, clock, self._setting.name, config.error_rates, given_up)

    def close(self) -> None:
        """End the thread after the search under way; searches that have not begun are dropped."""
        self._thread.shutdown(cancel_futures=True)

    def _parts(self, view: str, size: tuple[int, ...]) -> list[Part]:
        """Return the parts of a frame of a width and height [pixel] that a view means."""
        return parts_of(view, self._setting.camera.table_view, (size[0], size[1]))

    def _search(self, image: NDArray[np.uint8], parts: Sequence[Part]) -> list[Detection]:
        """Return the objects in the parts of a frame, most confident first; called in the thread."""
        raise NotImplementedError
