"""Counts and measurements over all images."""

from __future__ import annotations

import contextlib
import math
from collections import Counter, defaultdict
from collections.abc import Sequence

import numpy as np

from executive.cell.frame import Frame
from executive.cell.protocols import Localizer
from executive.errors import NoDepth
from executive.geometry import Array
from executive.perception.camera_model import intersect_plane
from executive.training.evaluation.error_rates import CountedRate, MeasuredErrorRates
from executive.training.evaluation.figures import NOTHING, ClassFigures
from executive.training.evaluation.matching import MIN_OVERLAP, BoxMatch, is_covered, overlap
from executive.training.labelled_image import LabelledImage


class Tally:
    """Counts of right and wrong detections, and distances between found and true places.

    Args:
        localizer: Computes the positions of detections, which are compared with the true ones.

    Attributes:
        by_count: Numbers of `objects` in full view, `missed` and `confused` ones, and `false_detections`,
            by the number of objects on the image.
        confusion: Number of detections by true and found class, `nothing` among both.
        centre: Distances between the centres of found and true box, of right detections [pixel of the image].
        position: These distances in the world, at the object's height, of objects wholly in view [mm].
        localized: Distances from the localizer's position to the object's true middle, of the same [mm].
    """

    def __init__(self, localizer: Localizer | None = None) -> None:
        self._localizer = localizer
        self._looks = 0
        self._squares: list[float] = []
        self.by_count: dict[int, Counter[str]] = defaultdict(Counter)
        self.confusion: Counter[tuple[str, str]] = Counter()
        self.centre, self.position, self.localized = list[float](), list[float](), list[float]()

    def add(self, matches: Sequence[BoxMatch], sample: LabelledImage, frame: Frame) -> None:
        """Count the answer to one image, with the detections that count."""
        self._looks += 1
        counts = self.by_count[len(sample.labels)]
        taken = {one.number: one for one in matches if one.number is not None}
        for number, label in enumerate(sample.labels):
            one = taken.get(number)
            self.confusion[label, one.detection.label if one else NOTHING] += 1
            if sample.is_fully_visible(number) and (one or not is_covered(number, matches, sample)):
                is_confused = one is not None and not one.right
                counts.update(objects=1, missed=one is None, confused=is_confused)
            if one is not None and one.right:
                self._measure(one, number, sample, frame)
        false_detections = [one.detection.label for one in matches if one.number is None]
        self.confusion.update((NOTHING, label) for label in false_detections)
        counts.update(false_detections=len(false_detections))

    @property
    def objects(self) -> int:
        """Number of objects on the images."""
        return sum(count for (true, _), count in self.confusion.items() if true != NOTHING)

    @property
    def precision(self) -> float:
        """Share of the detections that are right; 0 without detections."""
        found = sum(count for (_, label), count in self.confusion.items() if label != NOTHING)
        return self._right / max(found, 1)

    @property
    def recall(self) -> float:
        """Share of the objects that were found; 0 without objects."""
        return self._right / max(self.objects, 1)

    def by_class(self) -> dict[str, ClassFigures]:
        """Return the figures of every class that is on the images."""
        table = self.table()
        figures = {}
        for label in sorted(set(table) - {NOTHING}):
            right, objects = self.confusion[label, label], sum(table[label].values())
            found = sum(row.get(label, 0) for row in table.values())
            figures[label] = ClassFigures(objects, right / max(found, 1), right / objects)
        return figures

    def table(self) -> dict[str, dict[str, int]]:
        """Return the table of confusions: true class, then found class, then number of detections."""
        rows, columns = (
            sorted({pair[side] for pair in self.confusion}, key=lambda label: (label == NOTHING, label))
            for side in (0, 1)
        )
        return {true: {found: self.confusion[true, found] for found in columns} for true in rows}

    def estimate_error_rates(self, repeats: RepeatedErrors) -> MeasuredErrorRates | None:
        """Return the error rates on objects in full view, or None without an answer."""
        if not self._looks:
            return None
        counts = sum(self.by_count.values(), Counter[str]())
        total = float(np.sqrt(np.mean(self._squares))) if self._squares else 0.0
        return MeasuredErrorRates(
            miss_rate=CountedRate.share(counts["missed"], counts["objects"]),
            confusion_rate=CountedRate.share(counts["confused"], counts["objects"] - counts["missed"]),
            false_detections=CountedRate.per_trial(counts["false_detections"], self._looks),
            jitter=total if repeats.jitter is None else repeats.jitter,
            repeated=repeats.repeated_share,
            bias=repeats.bias,
        )

    @property
    def _right(self) -> int:
        return sum(count for (true, found), count in self.confusion.items() if true == found)

    def _measure(self, one: BoxMatch, number: int, sample: LabelledImage, frame: Frame) -> None:
        """Measure the distance of a right detection from the object `number`."""
        self.centre.append(float(np.hypot(*one.offset)))
        if sample.is_fully_visible(number):
            self._squares += ((one.offset * sample.pixel_scale) ** 2).tolist()
        if not sample.is_fully_inside(number):
            return
        if "positions" in sample.truth:
            true = np.array(sample.truth["positions"][number])
            seen = intersect_plane(frame.matrix, frame.X_WC, one.detection.centre, true[2])
            self.position.append(float(np.linalg.norm(seen - true) * 1000))
        if self._localizer is not None and "centres" in sample.truth:
            # Without a depth an object has no place in a run either.
            with contextlib.suppress(NoDepth):
                located = self._localizer.locate(one.detection, frame)
                true = np.array(sample.truth["centres"][number])
                self.localized.append(float(np.linalg.norm(located - true) * 1000))


class RepeatedErrors:
    """Counts the errors that a second look repeats, and separates random from systematic position errors.

    The second look differs in the noise of the sensor only. Half the mean squared difference of the two
    errors is the variance of the random error; their mean product is the variance of the systematic error.

    Args:
        localizer: Turns detections into positions; None: no systematic error of a position is measured.

    Attributes:
        errors: Number of errors of the first looks.
        repeated: Number of errors of the first looks that the second looks repeated.
    """

    def __init__(self, localizer: Localizer | None) -> None:
        self._localizer = localizer
        self.errors = self.repeated = 0
        self._random: list[float] = []
        self._systematic: list[float] = []

    def add(
        self, first: Sequence[BoxMatch], second: Sequence[BoxMatch], sample: LabelledImage, frame: Frame
    ) -> None:
        """Count the errors in the answers to two images of one scene, and those that are repeated."""
        before = {one.number: one for one in first if one.number is not None}
        after = {one.number: one for one in second if one.number is not None}
        for number, label in enumerate(sample.labels):
            if not sample.is_fully_visible(number):
                continue
            one, other = before.get(number), after.get(number)
            if one is None and is_covered(number, first, sample):
                continue
            found, again = one and one.detection.label, other and other.detection.label
            self.errors += found != label
            self.repeated += found != label and found == again
            if one and other and one.right and other.right:
                self._compare(one, other, sample, frame)
        false_detections = [one.detection for one in second if one.number is None]
        for false in (one.detection for one in first if one.number is None):
            alike = [one.box for one in false_detections if one.label == false.label]
            self.errors += 1
            self.repeated += bool(overlap([false.box], alike).max(initial=0.0) >= MIN_OVERLAP)

    @property
    def repeated_share(self) -> float:
        """Share of the errors that a second look repeats, estimated by Laplace's rule of succession."""
        return (self.repeated + 1) / (self.errors + 2)

    @property
    def jitter(self) -> float | None:
        """Standard deviation of the random error of a box's centre [pixel of the frame]; None if unknown."""
        return float(np.sqrt(np.mean(self._random))) if self._random else None

    @property
    def bias(self) -> float:
        """Standard deviation of the systematic error of a position, along each axis of the table [m]."""
        variance = float(np.mean(self._systematic)) if self._systematic else 0.0
        return math.sqrt(max(variance, 0.0))

    def _compare(self, one: BoxMatch, other: BoxMatch, sample: LabelledImage, frame: Frame) -> None:
        """Compare the boxes and positions of one object in both looks."""
        assert one.number is not None
        difference = (one.offset - other.offset) * sample.pixel_scale
        self._random += (difference**2 / 2).tolist()
        if self._localizer is None or "centres" not in sample.truth:
            return
        true = np.array(sample.truth["centres"][one.number])
        with contextlib.suppress(NoDepth):
            errors: list[Array] = [
                (self._localizer.locate(match.detection, frame) - true)[:2] for match in (one, other)
            ]
            self._systematic += (errors[0] * errors[1]).tolist()
