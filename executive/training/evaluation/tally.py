"""Counts and measurements over all images."""

from __future__ import annotations

import contextlib
from collections import Counter, defaultdict
from collections.abc import Sequence

import numpy as np

from executive.cell.frame import Frame
from executive.cell.protocols import Localizer
from executive.errors import NoDepth
from executive.perception.camera_model import intersect_plane
from executive.training.evaluation.error_rates import CountedRate, MeasuredErrorRates
from executive.training.evaluation.figures import NOTHING, ClassFigures
from executive.training.evaluation.matching import Match, is_covered
from executive.training.evaluation.repeats import RepeatedErrors
from executive.training.labelled_image import LabelledImage


class Tally:
    """Counts of right and wrong detections, and distances between found and true places.

    Args:
        localizer: Computes the positions of detections, which are compared with the true ones.

    Attributes:
        by_count: Numbers of `objects` in full view, `missed`, `confused` and `invented` ones by the number of
            objects on the image.
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

    def add(self, matches: Sequence[Match], sample: LabelledImage, frame: Frame) -> None:
        """Count the answer to one image, with the detections that count."""
        self._looks += 1
        counts = self.by_count[len(sample.labels)]
        taken = {one.number: one for one in matches if one.number is not None}
        for number, label in enumerate(sample.labels):
            one = taken.get(number)
            self.confusion[label, one.detection.label if one else NOTHING] += 1
            if sample.is_in_full_view(number) and (one or not is_covered(number, matches, sample)):
                is_confused = one is not None and not one.right
                counts.update(objects=1, missed=one is None, confused=is_confused)
            if one is not None and one.right:
                self._measure(one, number, sample, frame)
        invented = [one.detection.label for one in matches if one.number is None]
        self.confusion.update((NOTHING, label) for label in invented)
        counts.update(invented=len(invented))

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
            misses=CountedRate.share(counts["missed"], counts["objects"]),
            confused=CountedRate.share(counts["confused"], counts["objects"] - counts["missed"]),
            invented=CountedRate.per_trial(counts["invented"], self._looks),
            jitter=total if repeats.jitter is None else repeats.jitter,
            repeated=repeats.repeated_share,
            bias=repeats.bias,
        )

    @property
    def _right(self) -> int:
        return sum(count for (true, found), count in self.confusion.items() if true == found)

    def _measure(self, one: Match, number: int, sample: LabelledImage, frame: Frame) -> None:
        """Measure the distance of a right detection from the object `number`."""
        self.centre.append(float(np.hypot(*one.offset)))
        if sample.is_in_full_view(number):
            self._squares += ((one.offset * sample.pixel_size) ** 2).tolist()
        if not sample.is_whole(number):
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
