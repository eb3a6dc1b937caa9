"""Assignment of detections to labelled objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from executive.cell.detection import Detection
from executive.cell.frame import Box
from executive.geometry import Array
from executive.training.labelled_image import LabelledImage

MIN_COVERING_OVERLAP = 0.2
"""Overlap (intersection over union) from which a box covers a part of another object."""
MIN_OVERLAP = 0.5
"""Overlap (intersection over union) from which a box is the object's, or two boxes are at the same place."""


@dataclass(frozen=True)
class BoxMatch:
    """Object that a detection shows.

    Attributes:
        detection: The detection.
        number: Number of the object it lies on, or None where there is none.
        right: True if the detection has the class of that object.
        box: Box of that object [pixel]; that of the detection where there is none.
    """

    detection: Detection
    number: int | None
    right: bool
    box: Box

    @property
    def offset(self) -> Array:
        """Vector from the centre of the object's box to that of the detection, `(2,)` [pixel]."""
        left, top, right, bottom = self.box
        return np.array(self.detection.centre) - [(left + right) / 2, (top + bottom) / 2]


def match(found: Sequence[Detection], sample: LabelledImage) -> list[BoxMatch]:
    """Return the object of each detection, the most confident detection first.

    Greedy: each detection takes the object of its own class that it overlaps most, if none has taken it; the
    detections that remain then take the objects that remain, whatever their class.
    """
    ranked = sorted(found, key=lambda one: -one.confidence)
    overlaps = overlap([one.box for one in ranked], sample.boxes)
    same_class = np.array([[one.label == label for label in sample.labels] for one in ranked], dtype=bool)
    taken: dict[int, int] = {}
    for allowed in (same_class.reshape(overlaps.shape), np.ones_like(overlaps)):
        for rank in range(len(ranked)):
            scores = overlaps[rank] * allowed[rank]
            if rank not in taken and scores.size and scores.max() >= MIN_OVERLAP:
                taken[rank] = int(scores.argmax())
                overlaps[:, taken[rank]] = 0.0
    matches = []
    for rank, one in enumerate(ranked):
        number = taken.get(rank)
        is_right = number is not None and sample.labels[number] == one.label
        matches.append(BoxMatch(one, number, is_right, one.box if number is None else sample.boxes[number]))
    return matches


def is_covered(number: int, matches: Sequence[BoxMatch], sample: LabelledImage) -> bool:
    """Return True if a detection of another object overlaps an object: it is looked at again afterwards."""
    others = [one.detection.box for one in matches if one.number not in (None, number)]
    return bool(overlap([sample.boxes[number]], others).max(initial=0.0) >= MIN_COVERING_OVERLAP)


def is_ignored(detection: Detection, sample: LabelledImage) -> bool:
    """Return True for a detection of one of the objects that may be found or not."""
    best = overlap([detection.box], sample.ignored).max(initial=0.0)
    return bool(best >= MIN_OVERLAP and best > overlap([detection.box], sample.boxes).max(initial=0.0))


def overlap(boxes: Sequence[Box], others: Sequence[Box]) -> NDArray[np.float32]:
    """Return the intersection over union of every box with every other one, `(N, M)`."""
    # The import takes half a second: only an evaluation pays for it.
    from supervision import box_iou_batch

    return np.asarray(box_iou_batch(np.array(boxes).reshape(-1, 4), np.array(others).reshape(-1, 4)))
