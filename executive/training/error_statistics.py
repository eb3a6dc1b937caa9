"""Assignment of detections to labelled objects, and statistics of the errors over all images."""

from __future__ import annotations

import contextlib
import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from supervision import box_iou_batch

from executive.cell.frame import Box, Detection, Frame
from executive.cell.protocols import Localizer
from executive.errors import NoDepth
from executive.geometry import Array
from executive.perception.camera_model import intersect_plane
from executive.training.dataset import LabelledImage
from executive.training.metrics import NO_OBJECT, ClassMetrics, CountedRate, MeasuredErrorRates

MIN_OCCLUDING_IOU = 0.2
"""Minimum intersection over union (IoU) of the boxes of two objects that occlude each other."""
MIN_IOU = 0.5
"""Minimum intersection over union (IoU) of two boxes that belong to the same object."""


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
    return np.asarray(box_iou_batch(np.array(boxes).reshape(-1, 4), np.array(other_boxes).reshape(-1, 4)))


class ErrorStatistics:
    """Counts of correct and wrong detections, and distances between detected and true positions.

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
        self._squared_offsets: list[float] = []

    def add(self, matches: Sequence[BoxMatch], sample: LabelledImage, frame: Frame) -> None:
        """Count the matches of one image, and measure the position errors of its correct detections."""
        self._image_count += 1
        counts = self.counts_by_object_count[len(sample.labels)]
        match_by_object, false_detections = split_matches(matches)
        for index, label in enumerate(sample.labels):
            match = match_by_object.get(index)
            self.confusion[label, match.detection.label if match else NO_OBJECT] += 1
            if sample.is_fully_visible(index) and (match or not is_occluded(index, matches, sample)):
                is_confused = match is not None and not match.is_correct
                counts.update(objects=1, missed=match is None, confused=is_confused)
            if match is not None and match.is_correct:
                self._measure_errors(match, index, sample, frame)
        self.confusion.update((NO_OBJECT, detection.label) for detection in false_detections)
        counts.update(false_detections=len(false_detections))

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

    def estimate_error_rates(self, repeats: RepeatedErrors) -> MeasuredErrorRates | None:
        """Return the error rates for fully visible objects, or None if there was no answer."""
        if not self._image_count:
            return None
        counts = sum(self.counts_by_object_count.values(), Counter[str]())
        detected_count = counts["objects"] - counts["missed"]
        jitter = float(np.sqrt(np.mean(self._squared_offsets))) if self._squared_offsets else 0.0
        return MeasuredErrorRates(
            miss_rate=CountedRate.estimate_proportion(counts["missed"], counts["objects"]),
            confusion_rate=CountedRate.estimate_proportion(counts["confused"], detected_count),
            false_detections=CountedRate.estimate_mean_count(counts["false_detections"], self._image_count),
            jitter=jitter if repeats.jitter is None else repeats.jitter,
            repeated=repeats.repeated_fraction,
            bias=repeats.bias,
        )

    def _measure_errors(self, match: BoxMatch, index: int, sample: LabelledImage, frame: Frame) -> None:
        """Measure the position errors of a correct detection of the object `index`."""
        self.centre_errors.append(float(np.hypot(*match.offset)))
        if sample.is_fully_visible(index):
            self._squared_offsets += ((match.offset * sample.pixel_scale) ** 2).tolist()
        if not sample.is_fully_inside(index):
            return
        if "positions" in sample.truth:
            true_position = np.array(sample.truth["positions"][index])
            position = intersect_plane(frame.matrix, frame.X_WC, match.detection.centre, true_position[2])
            self.position_errors.append(float(np.linalg.norm(position - true_position) * 1000))
        if self._localizer is not None and "centres" in sample.truth:
            # A run omits objects without a measured depth, too.
            with contextlib.suppress(NoDepth):
                position = self._localizer.locate(match.detection, frame)
                true_centre = np.array(sample.truth["centres"][index])
                self.localization_errors.append(float(np.linalg.norm(position - true_centre) * 1000))


class RepeatedErrors:
    """Errors that are repeated in a second image, and random and systematic parts of position errors.

    Two images of a scene differ only in the noise of the sensor, so that the systematic error of an object is
    equal in both images. Half the mean squared difference of the two errors is the variance of the random
    error; the mean product of the two errors is the variance of the systematic error.

    Args:
        localizer: Computes the positions of detections; None: systematic errors are not measured.

    Attributes:
        error_count: Number of errors in the first images.
        repeated_count: Number of errors in the first images that occur in the second images, too.
    """

    def __init__(self, localizer: Localizer | None) -> None:
        self._localizer = localizer
        self.error_count = 0
        self.repeated_count = 0
        # Values for each object and axis: variances in the image [pixel²], products on the table [m²].
        self._random_variances: list[float] = []
        self._error_products: list[float] = []

    def add(
        self, matches: list[BoxMatch], second_matches: list[BoxMatch], sample: LabelledImage, frame: Frame
    ) -> None:
        """Count the errors in the first image of a scene, and the errors that the second image repeats."""
        first_by_object, first_false_detections = split_matches(matches)
        second_by_object, second_false_detections = split_matches(second_matches)
        for index, label in enumerate(sample.labels):
            if not sample.is_fully_visible(index):
                continue
            first_match = first_by_object.get(index)
            second_match = second_by_object.get(index)
            if first_match is None and is_occluded(index, matches, sample):
                continue
            first_label = first_match and first_match.detection.label
            second_label = second_match and second_match.detection.label
            self.error_count += first_label != label
            self.repeated_count += first_label != label and first_label == second_label
            if first_match and second_match and first_match.is_correct and second_match.is_correct:
                self._add_errors(first_match, second_match, sample, frame)
        for detection in first_false_detections:
            boxes = [second.box for second in second_false_detections if second.label == detection.label]
            self.error_count += 1
            self.repeated_count += bool(compute_ious([detection.box], boxes).max(initial=0.0) >= MIN_IOU)

    @property
    def repeated_fraction(self) -> float:
        """Fraction of the errors that the second image repeats, estimated by Laplace's rule of succession."""
        return (self.repeated_count + 1) / (self.error_count + 2)

    @property
    def jitter(self) -> float | None:
        """Standard deviation of a box centre's random error [pixel of the frame]; None without a value."""
        return float(np.sqrt(np.mean(self._random_variances))) if self._random_variances else None

    @property
    def bias(self) -> float:
        """Standard deviation of the systematic error of a position, along each axis of the table [m]."""
        variance = float(np.mean(self._error_products)) if self._error_products else 0.0
        return math.sqrt(max(variance, 0.0))

    def _add_errors(self, first: BoxMatch, second: BoxMatch, sample: LabelledImage, frame: Frame) -> None:
        """Add the random and systematic errors of one object from its detections in both images."""
        assert first.object_index is not None
        difference = (first.offset - second.offset) * sample.pixel_scale
        self._random_variances += (difference**2 / 2).tolist()
        if self._localizer is None or "centres" not in sample.truth:
            return
        true_centre = np.array(sample.truth["centres"][first.object_index])
        with contextlib.suppress(NoDepth):
            positions = [self._localizer.locate(match.detection, frame) for match in (first, second)]
            errors = (np.array(positions) - true_centre)[:, :2]
            self._error_products += errors.prod(axis=0).tolist()
