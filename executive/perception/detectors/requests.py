"""Detectors that run in a thread, with answers that become available at reproducible times of the run."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from executive.cell.config import DetectorConfig
from executive.cell.device_config import CameraConfig
from executive.cell.frame import Answer, Detection, ErrorRates, Frame
from executive.cell.protocols import Clock, Detector, Request
from executive.errors import DeadlinePassed, Unavailable
from executive.perception.detectors.views import Region, list_regions
from executive.processes import wait_until_done

CLOCK_ROUNDING_ERROR = 1e-9
"""Maximum rounding error of a time on the clock [s]."""


class ClosableDetector(Detector, Protocol):
    """A detector that holds resources, such as a thread, until it is closed."""

    def close(self) -> None:
        """Wait for the running search, then release all resources."""


@dataclass(frozen=True)
class DetectorContext:
    """Parts of the cell and of the run that a detector uses.

    Attributes:
        name: Name of the detector in the cell file.
        camera: The camera whose frames the detector searches.
        clock: Clock of the run, which determines when answers become available.
        cell_folder: Folder of the cell file, to which paths in options are relative.
        seed: Random seed of the detector.
        get_detector: Function that returns a detector of the cell by name; the caller must not close it.
    """

    name: str
    camera: CameraConfig
    clock: Clock
    cell_folder: Path
    seed: int
    get_detector: Callable[[str], Detector]


@dataclass(frozen=True, eq=False)
class ChangedRequest:
    """Request with a changed answer; implements `executive.cell.protocols.Request`.

    Attributes:
        request: The original request.
        change_answer: Function that returns the changed answer for the original answer.
        detector: Name of the detector, which is added to error messages; "" to add nothing.
    """

    request: Request
    change_answer: Callable[[Answer], Answer]
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
        return self.change_answer(answer)


@dataclass(eq=False)
class PendingSearch:
    """Running detection; implements `executive.cell.protocols.Request`.

    Attributes:
        future: Detections, which are available after the thread has searched all regions.
        due_time: Time from which the answer is available [s].
        clock: Clock of the run.
        detector: Name of the detector.
        error_rates: Error rates of the detector.
        expiry_time: Time at which a detector that missed its deadline counts as unavailable [s].
    """

    future: Future[list[Detection]]
    due_time: float
    clock: Clock
    detector: str
    error_rates: ErrorRates
    expiry_time: float = -math.inf

    @property
    def ready(self) -> bool:
        """True from `due_time` on, or from `expiry_time` on if the detector missed its deadline.

        At `due_time`, this property waits for the thread. The time at which an answer becomes available
        therefore does not depend on the speed of the computer.
        """
        if self.clock.now < self.due_time - CLOCK_ROUNDING_ERROR:
            return False
        wait_until_done(self.future)
        is_late = isinstance(self.future.exception(), DeadlinePassed)
        return not is_late or self.clock.now >= self.expiry_time - CLOCK_ROUNDING_ERROR

    def result(self) -> Answer:
        """Return the answer of the detector.

        Raises:
            Unavailable: The detector gave no usable answer.
        """
        if not self.ready:
            problem = f"the answer is due at {self.due_time:.3f} s, and the time is {self.clock.now:.3f} s"
            raise RuntimeError(f"{problem}; wait until `ready` is true")
        return Answer(self.detector, tuple(self.future.result()), self.error_rates)


class ThreadedDetector:
    """Base class of detectors that run in their own thread; implements `ClosableDetector`.

    Args:
        config: Section of the detector in the cell file.
        context: Parts of the cell and of the run that the detector uses.
        timeout: Time from a request until the error of a missed deadline is available [s].
    """

    def __init__(self, config: DetectorConfig, context: DetectorContext, timeout: float = -math.inf) -> None:
        self._config, self._context, self._timeout = config, context, timeout
        self._thread = ThreadPoolExecutor(1, f"detector-{context.name}")

    def request(self, frame: Frame, view: str) -> PendingSearch:
        """Start the detection in a view of a frame: `table` (the workspace) or `full` (the whole image)."""
        regions = self._list_regions(view, frame.image.shape[1::-1])
        future = self._thread.submit(lambda: self._search(frame.image, regions))
        clock, config = self._context.clock, self._config
        due_time, expiry_time = clock.now + config.latency, clock.now + self._timeout
        return PendingSearch(future, due_time, clock, self._context.name, config.error_rates, expiry_time)

    def close(self) -> None:
        """End the thread after the running search; cancel all searches that have not started."""
        self._thread.shutdown(cancel_futures=True)

    def _list_regions(self, view: str, size: tuple[int, ...]) -> list[Region]:
        """Return the regions to search for a view; `size` is the width and height of the image [pixel]."""
        return list_regions(view, self._context.camera.table_view, (size[0], size[1]))

    def _search(self, image: NDArray[np.uint8], regions: Sequence[Region]) -> list[Detection]:
        """Return the detections in the regions of an image, most confident first; runs in the thread."""
        raise NotImplementedError
