"""Comparison of two looks from one pose: repeated errors, random and systematic position errors."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence

import numpy as np

from executive.cell.frame import Frame
from executive.cell.protocols import Localizer
from executive.errors import NoDepth
from executive.geometry import Array
from executive.training.evaluation.matching import MIN_OVERLAP, Match, is_covered, overlap
from executive.training.labelled_image import LabelledImage


class RepeatedErrors:
    """Counts the errors that a second look repeats, and separates random from systematic position errors.

    The second look differs in the noise of the sensor only. Half the mean squared difference of the two
    errors is the variance of the random error; their mean product is the variance of the systematic error.

    Args:
        localizer: Turns detections into positions; None: no systematic error of a position is measured.

    Attributes:
        errors: Number of errors of the first looks.
        repeated: Number of errors of the first looks that the second looks repeated.
    """

    def __init__(self, localizer: Localizer | None) -> None:
        self._localizer = localizer
        self.errors = self.repeated = 0
        self._random: list[float] = []
        self._systematic: list[float] = []

    def add(
        self, first: Sequence[Match], second: Sequence[Match], sample: LabelledImage, frame: Frame
    ) -> None:
        """Count the errors in the answers to two images of one scene, and those that are repeated."""
        before = {one.number: one for one in first if one.number is not None}
        after = {one.number: one for one in second if one.number is not None}
        for number, label in enumerate(sample.labels):
            if not sample.is_in_full_view(number):
                continue
            one, other = before.get(number), after.get(number)
            if one is None and is_covered(number, first, sample):
                continue
            found, again = one and one.detection.label, other and other.detection.label
            self.errors += found != label
            self.repeated += found != label and found == again
            if one and other and one.right and other.right:
                self._compare(one, other, sample, frame)
        invented = [one.detection for one in second if one.number is None]
        for false in (one.detection for one in first if one.number is None):
            alike = [one.box for one in invented if one.label == false.label]
            self.errors += 1
            self.repeated += bool(overlap([false.box], alike).max(initial=0.0) >= MIN_OVERLAP)

    @property
    def repeated_share(self) -> float:
        """Share of the errors that a second look repeats, estimated by Laplace's rule of succession."""
        return (self.repeated + 1) / (self.errors + 2)

    @property
    def jitter(self) -> float | None:
        """Standard deviation of the random error of a box's centre [pixel of the frame]; None if unknown."""
        return float(np.sqrt(np.mean(self._random))) if self._random else None

    @property
    def bias(self) -> float:
        """Standard deviation of the systematic error of a position, along each axis of the table [m]."""
        variance = float(np.mean(self._systematic)) if self._systematic else 0.0
        return math.sqrt(max(variance, 0.0))

    def _compare(self, one: Match, other: Match, sample: LabelledImage, frame: Frame) -> None:
        """Compare the boxes and positions of one object in both looks."""
        assert one.number is not None
        difference = (one.offset - other.offset) * sample.pixel_size
        self._random += (difference**2 / 2).tolist()
        if self._localizer is None or "centres" not in sample.truth:
            return
        true = np.array(sample.truth["centres"][one.number])
        with contextlib.suppress(NoDepth):
            errors: list[Array] = [
                (self._localizer.locate(match.detection, frame) - true)[:2] for match in (one, other)
            ]
            self._systematic += (errors[0] * errors[1]).tolist()
