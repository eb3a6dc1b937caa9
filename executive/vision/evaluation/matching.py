"""Which detection is which object."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from executive.messages import Box, Detection
from executive.vision.detectors.views import iou
from executive.vision.samples import LabelledImage

MATCH = 0.5
"""Overlap (intersection over union) from which a box is the object's."""


@dataclass(frozen=True)
class Match:
    """What a detection is.

    Attributes:
        detection: The detection.
        number: Number of the object it lies on, or None where there is none.
        right: Whether it has that object's class.
    """

    detection: Detection
    number: int | None
    right: bool


def match(found: Sequence[Detection], sample: LabelledImage) -> list[Match]:
    """Return what each detection is, the most confident first.

    Greedy: each takes the object of its own class that it overlaps most, if none has taken it; those that
    remain then take the objects that remain, whatever their class.
    """
    ranked = sorted(found, key=lambda one: -one.confidence)
    free = set(range(len(sample.labels)))
    taken: dict[int, int] = {}
    for same_class in (True, False):
        for rank, detection in enumerate(ranked):
            if rank in taken:
                continue
            rivals = (i for i in free if not same_class or sample.labels[i] == detection.label)
            best, overlap = _most_overlapped(detection.box, rivals, sample)
            if overlap >= MATCH:
                taken[rank] = best
                free.discard(best)
    return [_as_match(detection, taken.get(rank), sample) for rank, detection in enumerate(ranked)]


def is_ignored(detection: Detection, sample: LabelledImage) -> bool:
    """Tell whether a detection is one of the objects that may be found or not."""
    best = max((iou(detection.box, box) for box in sample.ignored), default=0.0)
    return best >= MATCH and all(iou(detection.box, box) < best for box in sample.boxes)


def _most_overlapped(box: Box, numbers: Iterable[int], sample: LabelledImage) -> tuple[int, float]:
    overlap, number = max(((iou(box, sample.boxes[i]), i) for i in numbers), default=(0.0, -1))
    return number, overlap


def _as_match(detection: Detection, number: int | None, sample: LabelledImage) -> Match:
    return Match(detection, number, number is not None and sample.labels[number] == detection.label)
