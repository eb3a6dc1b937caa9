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

MIN_OCCLUDING_IOU = 0.2
"""Minimum intersection over union (IoU) of two boxes of which one occludes a part of the other object."""
MIN_IOU = 0.5
"""Minimum intersection over union (IoU) of two boxes that belong to the same object."""


@dataclass(frozen=True)
class BoxMatch:
    """A detection and the labelled object to which it is assigned.

    Attributes:
        detection: The detection.
        object_index: Index of the object in the image's labels; None: the detection is false.
        is_correct: True if the detection has the class of the object.
        box: Box of the object [pixel]; for a false detection, its own box.
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

    Greedy assignment: each detection gets the free object of its own class with the highest IoU. Then each
    unassigned detection gets the free object of any class with the highest IoU.
    """
    ranked = sorted(detections, key=lambda detection: -detection.confidence)
    ious = compute_ious([detection.box for detection in ranked], sample.boxes)
    rows = [[detection.label == label for label in sample.labels] for detection in ranked]
    same_class = np.array(rows, dtype=bool)
    index_by_rank: dict[int, int] = {}
    for is_allowed in (same_class.reshape(ious.shape), np.ones_like(ious)):
        for rank in range(len(ranked)):
            object_ious = ious[rank] * is_allowed[rank]
            if rank not in index_by_rank and object_ious.size and object_ious.max() >= MIN_IOU:
                index_by_rank[rank] = int(object_ious.argmax())
                ious[:, index_by_rank[rank]] = 0.0
    matches = []
    for rank, detection in enumerate(ranked):
        index = index_by_rank.get(rank)
        is_correct = index is not None and sample.labels[index] == detection.label
        box = detection.box if index is None else sample.boxes[index]
        matches.append(BoxMatch(detection, index, is_correct, box))
    return matches


def is_occluded(index: int, matches: Sequence[BoxMatch], sample: LabelledImage) -> bool:
    """Return True if another detected object occludes the object, which then does not count as missed."""
    others = [match.detection.box for match in matches if match.object_index not in (None, index)]
    return bool(compute_ious([sample.boxes[index]], others).max(initial=0.0) >= MIN_OCCLUDING_IOU)


def is_ignored(detection: Detection, sample: LabelledImage) -> bool:
    """Return True if a detection shows an ignored object rather than a labelled one."""
    iou = compute_ious([detection.box], sample.ignored).max(initial=0.0)
    return bool(iou >= MIN_IOU and iou > compute_ious([detection.box], sample.boxes).max(initial=0.0))


def compute_ious(boxes: Sequence[Box], others: Sequence[Box]) -> NDArray[np.float32]:
    """Return the intersection over union of each box and each box of `others`, `(N, M)`."""
    # The import takes half a second; only an evaluation needs the package.
    from supervision import box_iou_batch

    return np.asarray(box_iou_batch(np.array(boxes).reshape(-1, 4), np.array(others).reshape(-1, 4)))
