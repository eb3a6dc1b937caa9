"""Detectors as skills see them: searches beside the control loop, with error rates and screened answers.

A kind of detector only searches a frame. This file adds all that every detector of a cell has in common.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import ClassVar

import numpy as np

from executive.cell.config import CellConfig, DetectorConfig
from executive.cell.device_config import CameraConfig
from executive.cell.devices import DeviceClock
from executive.cell.frame import Answer, Detection, ErrorRates, Frame, TrueFrame
from executive.cell.objects import BIN_THICKNESS, Bin, ObjectClass
from executive.errors import Crowded, DeadlinePassed, Interrupted, TickOverdue, Unavailable
from executive.perception.camera_model import intersect_plane
from executive.perception.detectors.detector_registry import (
    DetectorContext,
    DetectorKind,
    KindMaker,
    build_kinds,
    close_kind,
    make_installed_kind,
)
from executive.perception.detectors.envelope import find_envelopes, rate_frame
from executive.processes import shut_down, wait_until_done

CLOCK_ROUNDING_ERROR = 1e-9
"""Maximum rounding error of a time on the clock [s]."""
MIN_VISIBLE_FRACTION = 0.7
"""Minimum unoccluded fraction of a box; boxes that the arm occludes more are ignored."""
MAX_BOXES = 60
"""Maximum number of boxes outside of the bins in one answer, including doubtful boxes and unknown labels.
Shipped cells have at most 20 objects, and the time for the assignment of boxes to items grows more than
linearly."""
MAX_BOXES_IN_BINS = 1000
"""Maximum number of boxes in the bins in one answer; a cell has room for fewer visible objects."""
MIN_BOX_SIDE = 2.0
"""Minimum longer side of a box [pixel]; a box in fractions of the image is smaller."""
MAX_BOX_SIDE = 1e5
"""Maximum longer side of a box [pixel]; all images are smaller, and squares of it do not overflow."""
MAX_LABEL_LENGTH = 100
"""Maximum number of characters of a label, which appears in messages and on the terminal."""
MAX_SECOND_CLASS_RATIO = 0.5
"""Maximum confidence of the second class of a confident detection, as a fraction of the first confidence."""


def build_cell_detectors(
    config: CellConfig, *, clock: DeviceClock, cell_folder: Path, seed: int,
    classes: Mapping[str, ObjectClass], folders: Sequence[Path] = (),
    make_kind: KindMaker = make_installed_kind,
) -> dict[str, CellDetector]:  # fmt: skip
    """Return the detectors of a cell by name, in the order of the cell file; the first is the default.

    Args:
        config: The cell file.
        clock: Clock of the devices, which determines when answers become available.
        cell_folder: Folder of the cell file, to which paths in the file are relative.
        seed: Random seed of the detectors.
        classes: Classes of the cell by label.
        folders: Folders with measurement files `CELL.measured.json`.
        make_kind: Makes the kind of each detector; fake cells and tests substitute `TruthDetector`.

    Raises:
        InputError: A detector cannot be built.
    """
    camera = next(iter(config.cameras.values()))
    kinds = build_kinds(
        config.detectors, camera=camera, cell_folder=cell_folder, seed=seed, make_kind=make_kind
    )
    has_real_kind = not all(getattr(kind, "is_fake", False) for kind in kinds.values())
    envelopes = find_envelopes(config, cell_folder, folders) if has_real_kind else {}
    label_map = {label: object_class.detected_label for label, object_class in classes.items()}
    bins = tuple(config.build_bins().values())
    detectors = {}
    for name, kind in kinds.items():
        section = config.detectors[name]
        envelope = envelopes.get(name, (section.error_rates, None))
        rate = partial(rate_frame, detector=name, envelope=envelope, config=config)
        detectors[name] = CellDetector(name, kind, section.latency, clock, rate, label_map, bins)
    return detectors


@dataclass(eq=False)
class CellDetector:
    """A detector of a cell; implements `executive.cell.protocols.Detector`.

    Attributes:
        name: Name of the detector in the cell file.
        kind: Finds the detections in a frame.
        latency: Minimum time from a request to its answer, on the clock of the run [s].
        clock: Clock of the devices.
        rate: Returns the error rates of the detector for a frame.
        label_map: For each class of the cell, the class that detectors report for it.
        bins: Bins of the cell, whose objects do not count as boxes of a crowded table.
    """

    name: str
    kind: DetectorKind
    latency: float
    clock: DeviceClock
    rate: Callable[[Frame], ErrorRates]
    label_map: Mapping[str, str]
    bins: Collection[Bin] = ()

    def __post_init__(self) -> None:
        is_instant = getattr(self.kind, "is_instant", False)
        self._thread = None if is_instant else ThreadPoolExecutor(1, f"detector-{self.name}")

    def request(self, frame: Frame, view: str) -> PendingAnswer:
        """Start the search of a view of a frame, in the thread of the detector."""
        search = partial(self._search, frame, view)
        future = _call_at_once(search) if self._thread is None else self._thread.submit(search)
        now = self.clock.now
        return PendingAnswer(future, self.clock, now, now + self.latency)

    def close(self) -> None:
        """End the running search, cancel all searches that have not started, and release all resources."""
        if self._thread is not None:
            self._thread.shutdown(wait=False, cancel_futures=True)
        close_kind(self.kind)
        if self._thread is not None:
            shut_down(self._thread)

    def _search(self, frame: Frame, view: str) -> Answer:
        """Return the screened answer for a frame.

        Boxes that the arm occludes, and doubtful boxes with unknown labels are omitted. The label of a class
        that looks like another class is replaced by the label of the other class.
        """
        try:
            detections = tuple(self.kind.detect(frame, view))
        except Unavailable as error:
            error.args = (f"detector {self.name}: {error}",)
            raise
        self._check_boxes(detections, frame, view)
        error_rates = self.rate(frame)
        confident: list[Detection] = []
        doubtful: list[Detection] = []
        unknown: list[Detection] = []
        for detection in detections:
            if frame.compute_visible_fraction(detection.box) < MIN_VISIBLE_FRACTION:
                continue
            label = self.label_map.get(detection.label)
            max_second_confidence = MAX_SECOND_CLASS_RATIO * detection.confidence
            is_above_threshold = detection.confidence >= error_rates.threshold
            is_confident = is_above_threshold and detection.second_confidence <= max_second_confidence
            if label:
                (confident if is_confident else doubtful).append(replace(detection, label=label))
            elif is_confident:
                unknown.append(detection)
        return Answer(self.name, tuple(confident), error_rates, tuple(doubtful), tuple(unknown))

    def _check_boxes(self, detections: Sequence[Detection], frame: Frame, view: str) -> None:
        """Raise Crowded if there are too many boxes, and Unavailable if a detection is invalid."""
        invalid = None
        count = len(detections)
        if count <= MAX_BOXES + MAX_BOXES_IN_BINS:
            invalid = next((found for found in detections if not _is_valid(found, frame)), None)
        if invalid is not None:
            box = f"{invalid.label[:MAX_LABEL_LENGTH]!r} {invalid.confidence:g} at {invalid.box}"
            image = f"an image of {frame.visible.shape[1]} x {frame.visible.shape[0]} pixels"
            raise Unavailable(f"detector {self.name} returned an invalid box: {box} in {image}")
        if MAX_BOXES < count <= MAX_BOXES + MAX_BOXES_IN_BINS:
            count = sum(not self._is_in_bin(detection, frame) for detection in detections)
        if count > MAX_BOXES:
            problem = f"found {count} boxes in the view {view}, which cannot all be objects"
            advice = "raise `floor` of the detector in the cell file, or use another detector"
            raise Crowded(f"detector {self.name} {problem}; at most {MAX_BOXES} are allowed: {advice}")

    def _is_in_bin(self, detection: Detection, frame: Frame) -> bool:
        """Return True if the centre of a box lies in a bin, on its floor or at the height of its walls."""
        for bin in self.bins:
            for height in (0.0, float(bin.size[2])):
                # The ray of a pixel above the horizon intersects no horizontal plane.
                with contextlib.suppress(ValueError):
                    centre = intersect_plane(frame.matrix, frame.X_WC, detection.centre, height)
                    if bin.contains(centre, BIN_THICKNESS):
                        return True
        return False


@dataclass(frozen=True, eq=False)
class PendingAnswer:
    """Running or finished search; implements `executive.cell.protocols.Request`.

    Attributes:
        future: Screened answer of the search, or its error.
        clock: Clock of the devices.
        request_time: Time of the request [s].
        due_time: Time from which the answer is available [s].
    """

    future: Future[Answer]
    clock: DeviceClock
    request_time: float
    due_time: float

    @property
    def ready(self) -> bool:
        """True from `due_time` on; the error of a missed deadline is available when the deadline has passed.

        On a simulated clock, this property waits at `due_time` for the search. The time at which an answer
        becomes available therefore does not depend on the speed of the computer.
        """
        if self.clock.now < self.due_time - CLOCK_ROUNDING_ERROR:
            return False
        if self.clock.is_simulated:
            wait_until_done(self.future)
        elif not self.future.done():
            return False
        error = self.future.exception()
        if not isinstance(error, DeadlinePassed):
            return True
        return self.clock.now >= self.request_time + error.timeout - CLOCK_ROUNDING_ERROR

    def result(self) -> Answer:
        """Return the answer of the detector."""
        if not self.ready:
            problem = f"the answer is due at {self.due_time:.3f} s, and the time is {self.clock.now:.3f} s"
            raise RuntimeError(f"{problem}; wait until `ready` is true")
        return self.future.result()


def _call_at_once(search: Callable[[], Answer]) -> Future[Answer]:
    future: Future[Answer] = Future()
    try:
        future.set_result(search())
    except (Interrupted, TickOverdue):
        raise
    except BaseException as error:
        future.set_exception(error)
    return future


def _is_valid(detection: Detection, frame: Frame) -> bool:
    """Return True if a detection has valid confidence, box and outline, and a printable label."""
    left, top, right, bottom = detection.box
    height, width = frame.visible.shape
    # These comparisons also reject NaN.
    sides = (right - left, bottom - top)
    is_box = min(sides) >= 0 and MIN_BOX_SIDE <= max(sides) <= MAX_BOX_SIDE
    is_in_image = right >= 0 and bottom >= 0 and left <= width and top <= height
    is_printable = detection.label.isprintable() and len(detection.label) <= MAX_LABEL_LENGTH
    is_outline = bool(np.isfinite(detection.outline or ()).all())
    return is_box and is_in_image and is_outline and 0 <= detection.confidence <= 1 and is_printable


TRUE_CONFIDENCE = 0.9
"""Confidence of true detections, unless the threshold in the cell file is higher."""


@dataclass(eq=False)
class TruthDetector:
    """Detector that returns the true detections of a `TrueFrame`, unless a test replaces `make_answer`.

    The detector omits boxes whose centre is outside the requested view or occluded by the arm.

    Attributes:
        camera: Camera of the frames.
        confidence: Confidence of all detections.
        seed: Random seed of the noise; each frame has its own noise.
        box_std: Standard deviation of the noise of each box coordinate [pixel].
        make_answer: Returns the detections, or a message if the detector is unavailable. Its arguments are
            the number of the request (from 1) and the true detections.
        request_count: Number of requests so far.
        is_fake: True: the error rates in the cell file need not be measured.
        is_instant: True: the detector needs no thread, which a fork of the process would not copy.
    """

    camera: CameraConfig
    confidence: float
    seed: int
    box_std: float = 0.0
    make_answer: Callable[[int, Sequence[Detection]], Sequence[Detection] | str] = field(
        default=lambda _request_number, true_detections: true_detections
    )
    request_count: int = 0
    is_fake: ClassVar[bool] = True
    is_instant: ClassVar[bool] = True

    @classmethod
    def from_config(
        cls, config: DetectorConfig, context: DetectorContext, box_std: float = 0.0
    ) -> TruthDetector:
        """Return a detector in place of the detector of any kind in a section of a cell file."""
        return cls(context.camera, max(TRUE_CONFIDENCE, config.threshold), context.seed, box_std)

    def detect(self, frame: Frame, view: str) -> Sequence[Detection]:
        """Return the true detections, with noise."""
        assert isinstance(frame, TrueFrame), "true detections require frames of a fake camera or TruthCamera"
        self.request_count += 1
        random_generator = np.random.default_rng([self.seed, frame.id])
        left, top, right, bottom = self.camera.get_view_box(view)
        detections = []
        for true_detection in frame.true_detections:
            sides = np.array(true_detection.box) + random_generator.normal(0.0, self.box_std, 4)
            box = (sides[0], sides[1], sides[2], sides[3])
            detection = replace(true_detection, box=box, confidence=self.confidence)
            column, row = detection.centre
            if left <= column < right and top <= row < bottom and frame.visible[int(row), int(column)]:
                detections.append(detection)
        answer = self.make_answer(self.request_count, detections)
        if isinstance(answer, str):
            raise Unavailable(answer)
        return answer
