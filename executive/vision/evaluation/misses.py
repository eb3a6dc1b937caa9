"""The worst mistakes of a detector, kept to be looked at."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from executive.messages import Box, Detection
from executive.vision.evaluation.matching import Match
from executive.vision.evaluation.tally import offset_of
from executive.vision.evaluation.truth import is_whole, visible_fraction
from executive.vision.samples import LabelledImage


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
    """Keeps the worst mistakes of all images it is told of.

    Args:
        most: How many.
    """

    def __init__(self, most: int = 24) -> None:
        self._most = most
        self._kept: list[tuple[float, int, Miss]] = []
        self._count = itertools.count()

    def add(self, matches: Sequence[Match], sample: LabelledImage) -> None:
        """Look for mistakes in the answer to one image."""
        for miss in misses(matches, sample):
            # Of equally bad ones the first stays; the number also keeps misses from being compared.
            heapq.heappush(self._kept, (miss.severity, -next(self._count), miss))
            if len(self._kept) > self._most:
                heapq.heappop(self._kept)

    def worst(self) -> list[Miss]:
        """Return them, the worst first."""
        return [miss for _, _, miss in sorted(self._kept, key=lambda kept: kept[:2], reverse=True)]


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
            yield _off(one, one.number, sample, found)


def _off(one: Match, number: int, sample: LabelledImage, found: tuple[Detection, ...]) -> Miss:
    true = sample.boxes[number]
    offset = float(np.hypot(*offset_of(one, number, sample)))
    size = max(true[2] - true[0], true[3] - true[1], 1.0)
    text = f"{one.detection.label} off by {offset:.1f} px"
    return Miss(min(offset / size, 1.0), text, _around(one.detection.box, true), sample, found)


def _around(one: Box, other: Box) -> Box:
    """Return the box around two boxes."""
    return min(one[0], other[0]), min(one[1], other[1]), max(one[2], other[2]), max(one[3], other[3])
