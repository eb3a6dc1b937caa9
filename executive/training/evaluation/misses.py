"""Worst mistakes of a detector, for a picture of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from executive.cell.detection import Detection
from executive.cell.frame import Box
from executive.training.evaluation.matching import Match
from executive.training.labelled_image import LabelledImage


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
    """Yield the mistakes in the answer to one image, and every right detection with the offset of its box."""
    found = tuple(one.detection for one in matches)
    taken = {one.number for one in matches}
    for number, label in enumerate(sample.labels):
        if number not in taken:
            share = sample.visible_fraction(number)
            cut = "" if sample.is_whole(number) else ", cut off"
            showing = "" if share >= 0.995 else f", {share:.0%} visible"
            text = f"{label} overlooked{showing}{cut}"
            yield Miss(share / (2 if cut else 1), text, sample.boxes[number], sample, found)
    for one in matches:
        box, severity = one.detection.box, one.detection.confidence
        text = f"{one.detection.label} {severity:.2f}"
        if one.right:
            offset = float(np.hypot(*one.offset))
            size = max(one.box[2] - one.box[0], one.box[3] - one.box[1], 1.0)
            severity, text = min(offset / size, 1.0), f"{one.detection.label} off by {offset:.1f} px"
        elif one.number is None:
            text = f"no such thing: {text}"
        else:
            text = f"{sample.labels[one.number]} taken for {text}"
        left, top, right, bottom = one.box
        around = min(box[0], left), min(box[1], top), max(box[2], right), max(box[3], bottom)
        yield Miss(severity, text, around, sample, found)
