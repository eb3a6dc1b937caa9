"""Metrics of a detector: assignment of detections to labelled objects, error statistics, and error rates.

The error rates have exact one-sided upper confidence bounds. Sources: Clopper and Pearson, Biometrika 26
(1934), 404-413; Garwood, Biometrika 28 (1936), 437-442.
"""

from __future__ import annotations

import contextlib
import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv, gammaincinv

from executive.cell.frame import Box, Detection, Frame
from executive.cell.protocols import Localizer
from executive.errors import NoDepth
from executive.geometry import Array
from executive.perception.camera_model import intersect_plane
from executive.perception.detectors.envelope import FrameRange, StoredErrorRates, WitnessCounts
from executive.training.dataset import LabelledImage

NO_OBJECT = "nothing"
"""Detected class of a missed object, and true class of a false detection, in a confusion matrix."""
CONFIDENCE_LEVEL = 0.95
"""Confidence level of the upper bounds of error rates."""
MAX_PROPORTION = 0.99
"""Maximum stored proportion: with a miss rate of 1, a frame would give no information."""
MIN_JITTER = 0.01
"""Minimum stored jitter [pixel]: with a jitter of 0, a position from one frame would count as exact."""
MIN_OCCLUDING_IOU = 0.2
"""Minimum intersection over union (IoU) of the boxes of two objects that occlude each other."""
MIN_IOU = 0.5
"""Minimum intersection over union (IoU) of two boxes that belong to the same object."""


@dataclass(frozen=True)
class Distribution:
    """Quantiles of a measured quantity, in the unit of the quantity.

    Attributes:
        median, p95, p99, worst: Median, 95th percentile, 99th percentile, and maximum.
    """

    median: float
    p95: float
    p99: float
    worst: float

    @staticmethod
    def compute(values: Sequence[float]) -> Distribution | None:
        """Return the distribution of `values`, or None if there are no values."""
        if not len(values):
            return None
        return Distribution(*np.percentile(values, [50, 95, 99, 100]).tolist())


@dataclass(frozen=True)
class ClassMetrics:
    """Accuracy of a detector for one or more classes.

    Attributes:
        objects: Number of objects of these classes.
        precision: Fraction of the detections of these classes that have the correct class and an IoU of at
            least 0.5.
        recall: Fraction of the objects that are detected with their class.
    """

    objects: int
    precision: float
    recall: float


@dataclass(frozen=True)
class CountedRate:
    """Measured frequency of an event, with a confidence bound.

    Attributes:
        events: Number of events.
        trials: Number of trials.
        bound: Upper 95 % confidence bound of the frequency.
    """

    events: int
    trials: int
    bound: float

    @staticmethod
    def estimate_proportion(events: int, trials: int) -> CountedRate:
        """Return the proportion of trials with an event; the bound is 1 if all trials have an event."""
        # The bound is a quantile of the beta distribution (Clopper and Pearson).
        bound = float(betaincinv(events + 1, trials - events, CONFIDENCE_LEVEL)) if events < trials else 1.0
        return CountedRate(events, trials, bound)

    @staticmethod
    def estimate_mean_count(events: int, trials: int) -> CountedRate:
        """Return the mean number of events per trial, which can exceed 1."""
        # The bound of the number of events is a quantile of the gamma distribution (Garwood).
        return CountedRate(events, trials, float(gammaincinv(events + 1, CONFIDENCE_LEVEL)) / trials)


@dataclass(frozen=True)
class MeasuredErrorRates:
    """Measured error rates of a detector.

    Attributes:
        miss_rate: Proportion of missed objects among the fully visible objects.
        confusion_rate: Proportion of wrong classes among the detected, fully visible objects.
        false_detections: Mean number of false detections per image.
        jitter: Standard deviation of the random error of a box's centre, along each axis [pixel].
        repeated: Laplace estimate of the fraction of errors that a second frame from the same pose repeats.
        bias: Standard deviation of the systematic error of a position, along each axis [m].
    """

    miss_rate: CountedRate
    confusion_rate: CountedRate
    false_detections: CountedRate
    jitter: float
    repeated: float
    bias: float

    @property
    def rates(self) -> StoredErrorRates:
        """Error rates for the ledger, rounded up; each `CountedRate` is replaced by its bound."""
        return StoredErrorRates(
            miss_rate=min(round_up(self.miss_rate.bound), MAX_PROPORTION),
            confusion_rate=min(round_up(self.confusion_rate.bound), MAX_PROPORTION),
            false_detections=round_up(self.false_detections.bound),
            jitter=max(round_up(self.jitter), MIN_JITTER),
            repeated=min(round_up(self.repeated), MAX_PROPORTION),
            bias=round_up(self.bias),
        )


@dataclass(frozen=True)
class Evaluation(ClassMetrics):
    """Accuracy of a detector for all classes in labelled images; images without an answer have no objects.

    Attributes:
        threshold: Minimum confidence of a detection.
        images: Number of images, including images without an answer.
        map50: Mean average precision at IoU 0.5 over detections with any confidence.
        map50_95: Mean average precision over IoUs from 0.5 to 0.95.
        centre: Distance between the centres of the detected and the true box [pixel].
        position: Distance from the true centre to the detected one, projected to the true height [mm].
        localized: Distance from the true centre to the position that the localizer computes [mm].
        latency: Wall time from a frame to its detections [ms], without the first image.
        by_class: Metrics of each class.
        confusion: Number of objects by true class, then by detected class; either can be `nothing`.
        unavailable: Number of images without a usable answer of the detector.
        why: Message of the last unusable answer, or "".
        answered_by: Number of answers by name of the answering detector.
        by_count: Error counts by number of objects in the image. The keys of each row are `objects` (fully
            visible), `missed`, `confused` and `false_detections`.
        reliability: Error rates for the ledger; None if there was no answer.
        witness: Objects that the witness of an empty table finds; None without a cell.
        frames: Brightness, contrast and colours of the workspace; None if no image shows all of it.
    """

    threshold: float
    images: int
    map50: float
    map50_95: float
    centre: Distribution | None = None
    position: Distribution | None = None
    localized: Distribution | None = None
    latency: Distribution | None = None
    by_class: Mapping[str, ClassMetrics] = field(default_factory=dict)
    confusion: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    unavailable: int = 0
    why: str = ""
    answered_by: Mapping[str, int] = field(default_factory=dict)
    by_count: Mapping[int, Mapping[str, int]] = field(default_factory=dict)
    reliability: MeasuredErrorRates | None = None
    witness: WitnessCounts | None = None
    frames: FrameRange | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return all metrics as JSON values."""
        values = asdict(self)
        values["frames"] = self.frames and self.frames.model_dump()
        values["witness"] = self.witness and self.witness.model_dump()
        if self.reliability is not None:
            values["reliability"]["rates"] = self.reliability.rates.model_dump()
        return values


def round_up(value: float, digits: int = 2) -> float:
    """Return `value` rounded up to `digits` significant digits, so that a rounded bound stays a bound."""
    if value <= 0:
        return 0.0
    places = digits - 1 - math.floor(math.log10(value))
    # The inner rounding removes floating-point errors, which `ceil` would round up.
    return round(math.ceil(round(value * 10**places, 6)) / 10**places, max(places, 0))


@dataclass(frozen=True)
class BoxMatch:
    """A detection and the labelled object to which it is assigned.

    Attributes:
        detection: The detection.
        object_index: Index of the object in `LabelledImage.labels`; None for a false detection.
        is_correct: True if the detection has the class of the object.
        box: Box of the object [pixel]; for a false detection, box of the detection.
    """

    detection: Detection
    object_index: int | None
    is_correct: bool
    box: Box

    @property
    def offset(self) -> Array:
        """Vector from the centre of the object's box to the centre of the detection, `(2,)` [pixel]."""
        left, top, right, bottom = self.box
        return np.array(self.detection.centre) - [(left + right) / 2, (top + bottom) / 2]


def match_detections(detections: Sequence[Detection], sample: LabelledImage) -> list[BoxMatch]:
    """Return the match of each detection, in descending order of confidence.

    The assignment is greedy: each detection gets the free object of the same class with the highest IoU.
    Then each unassigned detection gets the free object of any class with the highest IoU.
    """
    ranked = sorted(detections, key=lambda detection: -detection.confidence)
    ious = compute_ious([detection.box for detection in ranked], sample.boxes)
    is_same_class = [[detection.label == label for label in sample.labels] for detection in ranked]
    object_by_rank: dict[int, int] = {}
    for is_allowed in (np.array(is_same_class, dtype=bool).reshape(ious.shape), np.ones_like(ious)):
        for rank in range(len(ranked)):
            object_ious = ious[rank] * is_allowed[rank]
            if rank not in object_by_rank and object_ious.max(initial=0.0) >= MIN_IOU:
                object_by_rank[rank] = int(object_ious.argmax())
                # An IoU of 0 excludes the object from further assignments.
                ious[:, object_by_rank[rank]] = 0.0
    matches = []
    for rank, detection in enumerate(ranked):
        index = object_by_rank.get(rank)
        is_correct = index is not None and sample.labels[index] == detection.label
        box = detection.box if index is None else sample.boxes[index]
        matches.append(BoxMatch(detection, index, is_correct, box))
    return matches


def split_matches(matches: Sequence[BoxMatch]) -> tuple[dict[int, BoxMatch], list[Detection]]:
    """Return the matches of the detected objects by index of the object, and the false detections."""
    by_object = {match.object_index: match for match in matches if match.object_index is not None}
    return by_object, [match.detection for match in matches if match.object_index is None]


def is_occluded(index: int, matches: Sequence[BoxMatch], sample: LabelledImage) -> bool:
    """Return True if another detected object occludes the object with the given index."""
    other_boxes = [match.detection.box for match in matches if match.object_index not in (None, index)]
    return bool(compute_ious([sample.boxes[index]], other_boxes).max(initial=0.0) >= MIN_OCCLUDING_IOU)


def is_ignored(detection: Detection, sample: LabelledImage) -> bool:
    """Return True if a detection has a higher IoU with an ignored object than with any labelled object."""
    iou = compute_ious([detection.box], sample.ignored_boxes).max(initial=0.0)
    return bool(iou >= MIN_IOU and iou > compute_ious([detection.box], sample.boxes).max(initial=0.0))


def compute_ious(boxes: Sequence[Box], other_boxes: Sequence[Box]) -> NDArray[np.float32]:
    """Return the intersection over union of each of N boxes and each of M other boxes, `(N, M)`."""
    # The import takes half a second, for which the refusal of wrong inputs must not wait.
    from supervision import box_iou_batch

    return np.asarray(box_iou_batch(np.array(boxes).reshape(-1, 4), np.array(other_boxes).reshape(-1, 4)))


class ErrorStatistics:
    """Counts of correct and wrong detections, and distances between detected and true positions.

    Two images of a scene differ only in the noise of the sensor, so that the systematic error of an object is
    equal in both images. Half the mean squared difference of the two errors is the variance of the random
    error; the mean product of the two errors is the variance of the systematic error.

    Args:
        localizer: Computes the positions of detections; None: positions are not evaluated.

    Attributes:
        counts_by_object_count: Numbers of fully visible `objects`, `missed` and `confused` objects, and
            `false_detections`, by the number of objects in the image.
        confusion: Number of objects by true and detected class; either can be `nothing`.
        centre_errors: Distances of the centres of correct detections from the true centres [pixel].
        position_errors: Distances between detected and true centres in the world, at the height of the
            object, of objects that are completely in the searched region [mm].
        localization_errors: Distances between true centres and positions of the localizer, of objects that
            are completely in the searched region [mm].
    """

    def __init__(self, localizer: Localizer | None = None) -> None:
        self._localizer = localizer
        self._image_count = 0
        self.counts_by_object_count: dict[int, Counter[str]] = defaultdict(Counter)
        self.confusion: Counter[tuple[str, str]] = Counter()
        self.centre_errors: list[float] = []
        self.position_errors: list[float] = []
        self.localization_errors: list[float] = []
        # Numbers of errors in first images with a second image, and of those that the second image repeats.
        self._error_count = 0
        self._repeated_count = 0
        # Values for each object and axis: squares and variances in the image [pixel²], products on the table
        # [m²].
        self._squared_offsets: list[float] = []
        self._random_variances: list[float] = []
        self._error_products: list[float] = []

    def add(
        self, matches: Sequence[BoxMatch], second_matches: Sequence[BoxMatch] | None, sample: LabelledImage,
        frame: Frame,
    ) -> None:  # fmt: skip
        """Count the matches of one image, and measure the position errors of its correct detections.

        `second_matches` are the matches in a second image of the scene; None without a second image.
        """
        self._image_count += 1
        counts = self.counts_by_object_count[len(sample.labels)]
        match_by_object, false_detections = split_matches(matches)
        second_by_object, second_false_detections = split_matches(second_matches or ())
        for index, label in enumerate(sample.labels):
            match = match_by_object.get(index)
            second = second_by_object.get(index)
            self.confusion[label, match.detection.label if match else NO_OBJECT] += 1
            if sample.is_fully_visible(index) and (match or not is_occluded(index, matches, sample)):
                is_confused = match is not None and not match.is_correct
                counts.update(objects=1, missed=match is None, confused=is_confused)
                if second_matches is not None and (match is None or is_confused):
                    is_repeated = (match and match.detection.label) == (second and second.detection.label)
                    self._error_count += 1
                    self._repeated_count += is_repeated
            if match is not None and match.is_correct:
                is_comparable = second is not None and second.is_correct and sample.is_fully_visible(index)
                self._measure_errors(match, second if is_comparable else None, index, sample, frame)
        self.confusion.update((NO_OBJECT, detection.label) for detection in false_detections)
        # Each row has all keys, also if no object is fully visible.
        counts.update(objects=0, missed=0, confused=0, false_detections=len(false_detections))
        for detection in false_detections if second_matches is not None else ():
            boxes = [second.box for second in second_false_detections if second.label == detection.label]
            self._error_count += 1
            self._repeated_count += bool(compute_ious([detection.box], boxes).max(initial=0.0) >= MIN_IOU)

    @property
    def labels(self) -> list[str]:
        """True and detected classes, sorted."""
        return sorted({label for labels in self.confusion for label in labels} - {NO_OBJECT})

    def compute_metrics(self, labels: Sequence[str]) -> ClassMetrics:
        """Return the accuracy for some classes together; precision and recall are 0 without objects."""
        object_count = sum(count for (label, _), count in self.confusion.items() if label in labels)
        detection_count = sum(count for (_, label), count in self.confusion.items() if label in labels)
        correct_count = sum(self.confusion[label, label] for label in labels)
        precision = correct_count / max(detection_count, 1)
        return ClassMetrics(object_count, precision, correct_count / max(object_count, 1))

    def make_confusion_matrix(self) -> dict[str, dict[str, int]]:
        """Return the number of objects by true class (row), then by detected class (column)."""
        rows, columns = (
            sorted(labels, key=lambda label: (label == NO_OBJECT, label))
            for labels in ({row for row, _ in self.confusion}, {column for _, column in self.confusion})
        )
        return {row: {column: self.confusion[row, column] for column in columns} for row in rows}

    def estimate_error_rates(self) -> MeasuredErrorRates | None:
        """Return the error rates for fully visible objects, or None if there was no answer."""
        if not self._image_count:
            return None
        counts = sum(self.counts_by_object_count.values(), Counter[str]())
        detected_count = counts["objects"] - counts["missed"]
        # Without second images, all errors of box centres count as random errors.
        jitter_variance = np.mean(self._random_variances or self._squared_offsets or 0.0)
        bias_variance = float(np.mean(self._error_products or 0.0))
        return MeasuredErrorRates(
            miss_rate=CountedRate.estimate_proportion(counts["missed"], counts["objects"]),
            confusion_rate=CountedRate.estimate_proportion(counts["confused"], detected_count),
            false_detections=CountedRate.estimate_mean_count(counts["false_detections"], self._image_count),
            jitter=math.sqrt(jitter_variance),
            # Laplace's rule of succession estimates the fraction.
            repeated=(self._repeated_count + 1) / (self._error_count + 2),
            bias=math.sqrt(max(bias_variance, 0.0)),
        )

    def _measure_errors(
        self, match: BoxMatch, second: BoxMatch | None, index: int, sample: LabelledImage, frame: Frame
    ) -> None:
        """Measure the position errors of a correct detection of the object `index`, perhaps in two images."""
        self.centre_errors.append(float(np.hypot(*match.offset)))
        if sample.is_fully_visible(index):
            self._squared_offsets += ((match.offset * sample.pixel_scale) ** 2).tolist()
        if second is not None:
            difference = (match.offset - second.offset) * sample.pixel_scale
            self._random_variances += (difference**2 / 2).tolist()
        if not sample.is_fully_inside(index):
            return
        if "positions" in sample.truth:
            true_position = np.array(sample.truth["positions"][index])
            position = intersect_plane(frame.matrix, frame.X_WC, match.detection.centre, true_position[2])
            self.position_errors.append(float(np.linalg.norm(position - true_position) * 1000))
        if self._localizer is not None and "centres" in sample.truth:
            true_centre = np.array(sample.truth["centres"][index])
            # A run omits objects without a measured depth, too.
            with contextlib.suppress(NoDepth):
                error = self._localizer.locate(match.detection, frame) - true_centre
                self.localization_errors.append(float(np.linalg.norm(error) * 1000))
                if second is not None:
                    second_error = self._localizer.locate(second.detection, frame) - true_centre
                    self._error_products += (error * second_error)[:2].tolist()
