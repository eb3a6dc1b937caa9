"""Assignment of detections to labelled objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from executive.cell.detection import Detection
from executive.cell.frame import Box
from executive.geometry import Array
from executive.training.dataset import LabelledImage

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
    # The import takes half a second; only an evaluation needs the package.
    from supervision import box_iou_batch

    return np.asarray(box_iou_batch(np.array(boxes).reshape(-1, 4), np.array(other_boxes).reshape(-1, 4)))
