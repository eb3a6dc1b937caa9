"""Running counts over the images."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from executive.vision.evaluation.figures import NOTHING, ClassFigures
from executive.vision.evaluation.matching import Match
from executive.vision.evaluation.reliability import MeasuredReliability
from executive.vision.evaluation.truth import in_full_view, pixel_size
from executive.vision.samples import LabelledImage


@dataclass
class Tally:
    """Counts what was taken for what.

    Attributes:
        confusion: How often a true class was taken for another, `nothing` among both.
        offsets: Between the centres of found and true box, of right detections [pixel of the image].
    """

    confusion: Counter[tuple[str, str]] = field(default_factory=Counter)
    offsets: list[float] = field(default_factory=list)
    _looks: int = 0
    _whole: int = 0
    _overlooked: int = 0
    _confused: int = 0
    _squares: list[float] = field(default_factory=list)

    def add(self, matches: Sequence[Match], sample: LabelledImage) -> None:
        """Count the answer to one image, with the detections that count."""
        self._looks += 1
        taken = {one.number: one for one in matches if one.number is not None}
        for number, label in enumerate(sample.labels):
            one = taken.get(number)
            self.confusion[label, one.detection.label if one else NOTHING] += 1
            if in_full_view(sample, number):
                self._whole += 1
                self._overlooked += one is None
                self._confused += one is not None and not one.right
        for one in matches:
            if one.number is None:
                self.confusion[NOTHING, one.detection.label] += 1
            elif one.right:
                self._add_offset(one, one.number, sample)

    @property
    def objects(self) -> int:
        """Number of objects on the images."""
        return sum(count for (true, _), count in self.confusion.items() if true != NOTHING)

    @property
    def precision(self) -> float:
        """Share of the detections that are right; 0 where there were none."""
        return self._right() / max(sum(n for (_, found), n in self.confusion.items() if found != NOTHING), 1)

    @property
    def recall(self) -> float:
        """Share of the objects that were found; 0 where there were none."""
        return self._right() / max(self.objects, 1)

    def by_class(self) -> dict[str, ClassFigures]:
        """Return the figures of every class that is on the images."""
        figures = {}
        for label in sorted({true for true, _ in self.confusion} - {NOTHING}):
            right = self.confusion[label, label]
            objects = sum(count for (true, _), count in self.confusion.items() if true == label)
            found = sum(count for (_, taken), count in self.confusion.items() if taken == label)
            figures[label] = ClassFigures(objects, right / max(found, 1), right / objects)
        return figures

    def table(self) -> dict[str, dict[str, int]]:
        """Return the table of confusions: true class, then the class found, then how often."""
        rows = sorted({true for true, _ in self.confusion}, key=_nothing_last)
        columns = sorted({found for _, found in self.confusion}, key=_nothing_last)
        return {true: {found: self.confusion[true, found] for found in columns} for true in rows}

    def reliability(self) -> MeasuredReliability | None:
        """Return how the detector errs on objects in full view, None where nothing was answered."""
        if not self._looks:
            return None
        return MeasuredReliability.of(
            whole=self._whole,
            overlooked=self._overlooked,
            confused=self._confused,
            invented=sum(count for (true, _), count in self.confusion.items() if true == NOTHING),
            looks=self._looks,
            jitter=float(np.sqrt(np.mean(self._squares))) if self._squares else 0.0,
        )

    def _right(self) -> int:
        return sum(count for (true, found), count in self.confusion.items() if true == found)

    def _add_offset(self, one: Match, number: int, sample: LabelledImage) -> None:
        offset = offset_of(one, number, sample)
        self.offsets.append(float(np.hypot(*offset)))
        if in_full_view(sample, number):
            self._squares += ((offset * pixel_size(sample)) ** 2).tolist()


def offset_of(one: Match, number: int, sample: LabelledImage) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return how far the centre of a found box is from that of object `number`, `(2,)` [pixel]."""
    left, top, right, bottom = sample.boxes[number]
    return np.array(one.detection.centre) - [(left + right) / 2, (top + bottom) / 2]


def _nothing_last(label: str) -> tuple[bool, str]:
    return label == NOTHING, label
