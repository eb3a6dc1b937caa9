"""The figures that an evaluation gives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from executive.perception.envelope.frame_statistics import FrameRange
from executive.training.evaluation.error_rates import MeasuredErrorRates

NOTHING = "nothing"
"""What stands for the class of no object in a table of confusions."""


@dataclass(frozen=True)
class Distribution:
    """How a measured quantity is distributed, all in its unit.

    Attributes:
        median, p95, p99, worst: Its quantiles.
    """

    median: float
    p95: float
    p99: float
    worst: float

    @staticmethod
    def of(values: Sequence[float]) -> Distribution | None:
        """Return the spread of some values, None where there are none."""
        if not len(values):
            return None
        median, p95, p99, worst = np.percentile(values, [50, 95, 99, 100])
        return Distribution(float(median), float(p95), float(p99), float(worst))


@dataclass(frozen=True)
class ClassFigures:
    """How well one class is found.

    Attributes:
        objects: Number of its objects.
        precision: Share of the detections of this class that are right.
        recall: Share of its objects that were found as such.
    """

    objects: int
    precision: float
    recall: float


@dataclass(frozen=True)
class Evaluation:
    """What was measured; what an unavailable detector was not asked about is left out of every rate.

    Attributes:
        threshold: Confidence from which a detection counted.
        images: Number of images.
        objects: Number of objects on those that were answered.
        precision: Share of the detections that are right in class and place.
        recall: Share of the objects that were found.
        map50: Mean average precision at an overlap of 0.5, of all boxes from the detector's floor on.
        map50_95: The same, averaged over overlaps from 0.5 to 0.95.
        centre: Distance between the centres of found and true box [pixel of the image].
        position: That in the world, at the height of the object [mm]; None without a renderer's truth.
        localized: Distance of where the cell's localizer puts it from the object's true middle [mm].
        latency: Wall time from a frame to its detections [ms]; the first look does not count.
        by_class: Figures of each class.
        confusion: How often each class was taken for which, `nothing` among both.
        unavailable: Images about which the detector gave no usable answer.
        why: What it said when it did so for the last time, or "".
        answered_by: Number of answers by the name of the detector.
        by_count: Numbers of `objects` in full view, `missed` and `confused` ones, and `false_detections`,
            by the number of objects on the image.
        reliability: Error rates for the ledger; None where nothing was answered.
        frames: Brightness, contrast and colours of the workspace; None if no image showed all of it.
    """

    threshold: float
    images: int
    objects: int
    precision: float
    recall: float
    map50: float
    map50_95: float
    centre: Distribution | None = None
    position: Distribution | None = None
    localized: Distribution | None = None
    latency: Distribution | None = None
    by_class: Mapping[str, ClassFigures] = field(default_factory=dict)
    confusion: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    unavailable: int = 0
    why: str = ""
    answered_by: Mapping[str, int] = field(default_factory=dict)
    by_count: Mapping[int, Mapping[str, int]] = field(default_factory=dict)
    reliability: MeasuredErrorRates | None = None
    frames: FrameRange | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain values."""
        plain = asdict(self)
        plain["frames"] = self.frames and self.frames.model_dump()
        if self.reliability is not None:
            plain["reliability"]["rates"] = self.reliability.rates.model_dump()
        return plain
