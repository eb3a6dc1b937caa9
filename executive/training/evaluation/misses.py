"""Worst mistakes of a detector, for a picture of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from executive.cell.detection import Detection
from executive.cell.frame import Box
from executive.training.evaluation.matching import Match, offset_of
from executive.training.evaluation.truth import is_whole, visible_fraction
from executive.training.samples import LabelledImage


@dataclass(frozen=True, eq=False)
class Miss:
    """One mistake.

    Attributes:
        severity: 0 to 1; of an overlooked object how much of it showed, of a wrong detection its
            confidence, of a box off its place the offset as a share of the object's size.
        text: What is wrong, a few words.
        box: Where to look [pixel].
        sample: The image.
        found: All that counted on it.
    """

    severity: float
    text: str
    box: Box
    sample: LabelledImage
    found: tuple[Detection, ...]


class WorstMisses:
    """Keeps the worst mistakes of all images, the worst first and of equally bad ones the first.

    Args:
        count: Number of mistakes to keep.

    Attributes:
        kept: The mistakes.
    """

    def __init__(self, count: int = 24) -> None:
        self._count = count
        self.kept: list[Miss] = []

    def add(self, matches: Sequence[Match], sample: LabelledImage) -> None:
        """Look for mistakes in the answer to one image."""
        self.kept += misses(matches, sample)
        self.kept.sort(key=lambda miss: -miss.severity)
        del self.kept[self._count :]


def misses(matches: Sequence[Match], sample: LabelledImage) -> Iterator[Miss]:
    """Yield everything that is wrong in the answer to one image, and every box that is right but off."""
    found = tuple(one.detection for one in matches)
    taken = {one.number for one in matches}
    for number, label in enumerate(sample.labels):
        if number not in taken:
            share = visible_fraction(sample, number)
            box = sample.boxes[number]
            cut = "" if is_whole(box, sample) else ", cut off"
            showing = "" if share >= 0.995 else f", {share:.0%} visible"
            yield Miss(share / (2 if cut else 1), f"{label} overlooked{showing}{cut}", box, sample, found)
    for one in matches:
        box, confidence = one.detection.box, one.detection.confidence
        named = f"{one.detection.label} {confidence:.2f}"
        if one.number is None:
            yield Miss(confidence, f"no such thing: {named}", box, sample, found)
        elif not one.right:
            text = f"{sample.labels[one.number]} taken for {named}"
            yield Miss(confidence, text, _around(box, sample.boxes[one.number]), sample, found)
        else:
            true = sample.boxes[one.number]
            offset = float(np.hypot(*offset_of(one, one.number, sample)))
            size = max(true[2] - true[0], true[3] - true[1], 1.0)
            text = f"{one.detection.label} off by {offset:.1f} px"
            yield Miss(min(offset / size, 1.0), text, _around(box, true), sample, found)


def _around(one: Box, other: Box) -> Box:
    """Return the box around two boxes."""
    return min(one[0], other[0]), min(one[1], other[1]), max(one[2], other[2]), max(one[3], other[3])
