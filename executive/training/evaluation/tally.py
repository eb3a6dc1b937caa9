"""Running counts and measurements over the images."""

from __future__ import annotations

import contextlib
from collections import Counter, defaultdict
from collections.abc import Sequence

import numpy as np

from executive.cell.frame import Frame
from executive.cell.protocols import Localizer
from executive.errors import NoDepth
from executive.perception.camera_model import intersect_plane
from executive.training.evaluation.error_rates import MeasuredErrorRates
from executive.training.evaluation.figures import NOTHING, ClassFigures
from executive.training.evaluation.matching import Match, is_covered, offset_of
from executive.training.evaluation.repeats import RepeatedErrors
from executive.training.evaluation.truth import in_full_view, is_whole, pixel_size
from executive.training.samples import LabelledImage


class Tally:
    """Counts of right and wrong detections, and distances between found and true places.

    Args:
        localizer: Turns detections into positions, to be compared with the objects' true ones.

    Attributes:
        objects: Number of objects on the images.
        by_count: Numbers of `objects` in full view, `missed`, `confused` and `invented` ones by the number of
            objects on the image.
        confusion: Number of times that a true class was taken for another, `nothing` among both.
        centre: Distances between the centres of found and true box, of right detections [pixel of the image].
        position: These distances in the world, at the object's height, of objects wholly in view [mm].
        localized: Distances from the localizer's position to the object's true middle, of the same [mm].
    """

    def __init__(self, localizer: Localizer | None = None) -> None:
        self._localizer = localizer
        self._looks = self.objects = self._found = self._right = 0
        # Of objects in full view: how many there are, were overlooked and were given a wrong class.
        self._whole = self._overlooked = self._confused = 0
        self._squares: list[float] = []
        self.by_count: dict[int, Counter[str]] = defaultdict(Counter)
        self.confusion: Counter[tuple[str, str]] = Counter()
        self.centre: list[float] = []
        self.position: list[float] = []
        self.localized: list[float] = []

    def add(self, matches: Sequence[Match], sample: LabelledImage, frame: Frame) -> None:
        """Count the answer to one image, with the detections that count."""
        self._looks += 1
        self.objects += len(sample.labels)
        self._found += len(matches)
        self._right += sum(one.right for one in matches)
        taken = {one.number: one for one in matches if one.number is not None}
        for number, label in enumerate(sample.labels):
            one = taken.get(number)
            self.confusion[label, one.detection.label if one else NOTHING] += 1
            if in_full_view(sample, number) and (one or not is_covered(number, matches, sample)):
                missed, confused = one is None, one is not None and not one.right
                self._whole += 1
                self._overlooked += missed
                self._confused += confused
                self.by_count[len(sample.labels)].update(objects=1, missed=missed, confused=confused)
            if one is not None and one.right:
                self._measure(one, number, sample, frame)
        invented = [one.detection.label for one in matches if one.number is None]
        self.confusion.update((NOTHING, label) for label in invented)
        self.by_count[len(sample.labels)].update(invented=len(invented))

    @property
    def precision(self) -> float:
        """Share of the detections that are right; 0 where there were none."""
        return self._right / max(self._found, 1)

    @property
    def recall(self) -> float:
        """Share of the objects that were found; 0 where there were none."""
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
        """Return the table of confusions: true class, then the class found, then how often."""
        rows, columns = (
            sorted({pair[side] for pair in self.confusion}, key=lambda label: (label == NOTHING, label))
            for side in (0, 1)
        )
        return {true: {found: self.confusion[true, found] for found in columns} for true in rows}

    def estimate_error_rates(self, repeats: RepeatedErrors) -> MeasuredErrorRates | None:
        """Return the error rates on objects in full view, None where nothing was answered."""
        if not self._looks:
            return None
        total = float(np.sqrt(np.mean(self._squares))) if self._squares else 0.0
        return MeasuredErrorRates.of(
            full_view_count=self._whole,
            missed=self._overlooked,
            confused=self._confused,
            invented=sum(count for (true, _), count in self.confusion.items() if true == NOTHING),
            looks=self._looks,
            jitter=total if repeats.jitter is None else repeats.jitter,
            repeated=repeats.repeated_share,
            bias=repeats.bias,
        )

    def _measure(self, one: Match, number: int, sample: LabelledImage, frame: Frame) -> None:
        """Measure how far a right detection is from the object `number`."""
        offset = offset_of(one, number, sample)
        self.centre.append(float(np.hypot(*offset)))
        if in_full_view(sample, number):
            self._squares += ((offset * pixel_size(sample)) ** 2).tolist()
        if not is_whole(sample.boxes[number], sample):
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
