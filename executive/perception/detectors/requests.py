"""Detectors that run in a thread, and the screening of their answers.

Answers become available at reproducible times of the run.

Every answer of every kind of detector is screened before a skill reads it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from executive.cell.config import DetectorConfig
from executive.cell.device_config import CameraConfig
from executive.cell.frame import Answer, Detection, ErrorRates, Frame
from executive.cell.objects import ObjectClass
from executive.cell.protocols import Clock, Detector, Request
from executive.errors import Crowded, DeadlinePassed, Unavailable
from executive.perception.detectors.views import Region, list_regions
from executive.processes import wait_until_done

CLOCK_ROUNDING_ERROR = 1e-9
"""Maximum rounding error of a time on the clock [s]."""
MIN_VISIBLE_FRACTION = 0.7
"""Minimum unoccluded fraction of a box; boxes that the arm occludes more are ignored."""
MAX_BOXES = 60
"""Maximum number of boxes in one answer, including doubtful boxes and unknown labels. Shipped cells have at
most 20 objects, and the time for the assignment of boxes to items grows more than linearly."""
MIN_BOX_SIDE = 2.0
"""Minimum longer side of a box [pixel]; a box in fractions of the image is smaller."""
MAX_BOX_SIDE = 1e5
"""Maximum longer side of a box [pixel]; all images are smaller, and squares of it do not overflow."""
MAX_LABEL_LENGTH = 100
"""Maximum number of characters of a label, which appears in messages and on the terminal."""
MAX_SECOND_CLASS_RATIO = 0.5
"""Maximum confidence of the second class of a confident detection, as a fraction of the first confidence."""


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
        is_released: Function that returns False while the answer is held back.
    """

    request: Request
    change_answer: Callable[[Answer], Answer]
    detector: str = ""
    is_released: Callable[[], bool] = lambda: True

    @property
    def ready(self) -> bool:
        """True if the answer is available."""
        return self.request.ready and self.is_released()

    def result(self) -> Answer:
        """Return the changed answer."""
        try:
            answer = self.request.result()
        except Unavailable as error:
            if not self.detector:
                raise
            raise Unavailable(f"detector {self.detector}: {error}") from error
        return self.change_answer(answer)


@dataclass(frozen=True, eq=False)
class ChangedDetector:
    """Detector with changed answers; implements `ClosableDetector`.

    Attributes:
        detector: The detector.
        change_answer: Function of answer, frame and view that returns the changed answer.
        close: Function that releases the resources of the detector.
        name: Name of the detector, which is added to error messages; "" to add nothing.
    """

    detector: Detector
    change_answer: Callable[[Answer, Frame, str], Answer]
    close: Callable[[], None] = lambda: None
    name: str = ""

    def request(self, frame: Frame, view: str) -> ChangedRequest:
        """Start the detection."""
        request = self.detector.request(frame, view)
        return ChangedRequest(request, lambda answer: self.change_answer(answer, frame, view), self.name)


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
        """Return the answer of the detector."""
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
        self._config = config
        self._context = context
        self._timeout = timeout
        self._thread = ThreadPoolExecutor(1, f"detector-{context.name}")

    def request(self, frame: Frame, view: str) -> PendingSearch:
        """Start the detection in the thread."""
        regions = self._list_regions(view, frame.image.shape[1::-1])
        future = self._thread.submit(lambda: self._search(frame.image, regions))
        clock = self._context.clock
        due_time = clock.now + self._config.latency
        expiry_time = clock.now + self._timeout
        error_rates = self._config.error_rates
        return PendingSearch(future, due_time, clock, self._context.name, error_rates, expiry_time)

    def close(self) -> None:
        """End the thread after the running search; cancel all searches that have not started."""
        self._thread.shutdown(cancel_futures=True)

    def _list_regions(self, view: str, size: tuple[int, ...]) -> list[Region]:
        """Return the regions to search for a view; `size` is the width and height of the image [pixel]."""
        return list_regions(view, self._context.camera.table_view, (size[0], size[1]))

    def _search(self, image: NDArray[np.uint8], regions: Sequence[Region]) -> list[Detection]:
        """Return the detections in the regions of an image, most confident first; runs in the thread."""
        raise NotImplementedError


def screen_answer(answer: Answer, frame: Frame, view: str, label_map: Mapping[str, str]) -> Answer:
    """Return an answer with its detections divided into `confident`, `doubtful` and `unknown`.

    Boxes that the arm occludes, and doubtful boxes with unknown labels are omitted. The label of a class that
    looks like another class is replaced by the label of the other class.

    Args:
        answer: Answer with all detections in `confident`.
        frame: The searched frame.
        view: Name of the searched region, for an error message.
        label_map: For each class of the cell, the class that the detectors report for it.

    Raises:
        Crowded: There are more than `MAX_BOXES` boxes.
        Unavailable: A box, a confidence or a label is invalid, or a box does not fit the image.
    """
    if len(answer.confident) > MAX_BOXES:
        problem = f"found {len(answer.confident)} boxes in the view {view}, which cannot all be objects"
        advice = "raise `floor` of the detector in the cell file, or use another detector"
        raise Crowded(f"detector {answer.detector} {problem}; at most {MAX_BOXES} are allowed: {advice}")
    if invalid := next((found for found in answer.confident if not _is_valid(found, frame)), None):
        box = f"{invalid.label[:MAX_LABEL_LENGTH]!r} {invalid.confidence:g} at {invalid.box}"
        image = f"an image of {frame.visible.shape[1]} x {frame.visible.shape[0]} pixels"
        raise Unavailable(f"detector {answer.detector} returned an invalid box: {box} in {image}")
    threshold = answer.error_rates.threshold
    confident: list[Detection] = []
    doubtful: list[Detection] = []
    unknown: list[Detection] = []
    for detection in answer.confident:
        if frame.compute_visible_fraction(detection.box) < MIN_VISIBLE_FRACTION:
            continue
        label = label_map.get(detection.label)
        max_second_confidence = MAX_SECOND_CLASS_RATIO * detection.confidence
        is_confident = (
            detection.confidence >= threshold and detection.second_confidence <= max_second_confidence
        )
        if label:
            (confident if is_confident else doubtful).append(replace(detection, label=label))
        elif is_confident:
            unknown.append(detection)
    return replace(answer, confident=tuple(confident), doubtful=tuple(doubtful), unknown=tuple(unknown))


def _is_valid(detection: Detection, frame: Frame) -> bool:
    """Return True if a detection has a valid confidence, a printable label, and a valid box in the image."""
    left, top, right, bottom = detection.box
    height, width = frame.visible.shape
    # These comparisons also reject NaN.
    sides = (right - left, bottom - top)
    is_box = min(sides) >= 0 and MIN_BOX_SIDE <= max(sides) <= MAX_BOX_SIDE
    is_in_image = right >= 0 and bottom >= 0 and left <= width and top <= height
    is_printable = detection.label.isprintable() and len(detection.label) <= MAX_LABEL_LENGTH
    return is_box and is_in_image and 0 <= detection.confidence <= 1 and is_printable


def screen_detectors(
    detectors: Mapping[str, Detector], classes: Mapping[str, ObjectClass]
) -> dict[str, Detector]:
    """Return detectors with screened answers, by name; `classes` are the classes of the cell by label."""
    label_map = {label: object_class.detected_label for label, object_class in classes.items()}
    screen = partial(screen_answer, label_map=label_map)
    return {name: ChangedDetector(detector, screen, name=name) for name, detector in detectors.items()}
