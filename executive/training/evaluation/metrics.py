"""Metrics of an evaluation of a detector."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from executive.perception.envelope.frame_statistics import FrameRange
from executive.training.evaluation.measured_rates import MeasuredErrorRates

NO_OBJECT = "nothing"
"""Detected class of a missed object, and true class of a false detection, in a confusion matrix."""


@dataclass(frozen=True)
class Distribution:
    """Quantiles of a measured quantity, in the unit of the quantity.

    Attributes:
        median, p95, p99, worst: Median, 95th percentile, 99th percentile, and maximum.
    """

    median: float
    p95: float
    p99: float
    worst: float

    @staticmethod
    def compute(values: Sequence[float]) -> Distribution | None:
        """Return the distribution of `values`, or None if there are no values."""
        if not len(values):
            return None
        median, p95, p99, worst = np.percentile(values, [50, 95, 99, 100])
        return Distribution(float(median), float(p95), float(p99), float(worst))


@dataclass(frozen=True)
class ClassMetrics:
    """Accuracy of a detector for one or more classes.

    Attributes:
        objects: Number of objects of these classes.
        precision: Fraction of the detections of these classes that are correct.
        recall: Fraction of the objects that are detected with their class.
    """

    objects: int
    precision: float
    recall: float


@dataclass(frozen=True)
class Evaluation:
    """Accuracy of a detector on labelled images.

    Attributes:
        threshold: Minimum confidence of a detection.
        images: Number of images, including images without an answer.
        objects: Number of objects in the images with an answer.
        precision: Fraction of the detections that have the correct class and an IoU of at least 0.5.
        recall: Fraction of the objects that are detected with their class.
        map50: Mean average precision at IoU 0.5 over detections with any confidence.
        map50_95: Mean average precision over IoUs from 0.5 to 0.95.
        centre: Distance between the centres of the detected and the true box [pixel].
        position: Distance from the true centre to the detected one, projected to the true height [mm].
        localized: Distance from the true centre to the position that the localizer computes [mm].
        latency: Wall time from a frame to its detections [ms], without the first image.
        by_class: Metrics of each class.
        confusion: Number of objects by true class, then by detected class; either can be `nothing`.
        unavailable: Number of images without a usable answer of the detector.
        why: Message of the last unusable answer, or "".
        answered_by: Number of answers by name of the answering detector.
        by_count: Error counts by number of objects in the image. The keys of each row are `objects` (fully
            visible), `missed`, `confused` and `false_detections`.
        reliability: Error rates for the ledger; None if there was no answer.
        frames: Brightness, contrast and colours of the workspace; None if no image shows all of it.
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
    by_class: Mapping[str, ClassMetrics] = field(default_factory=dict)
    confusion: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    unavailable: int = 0
    why: str = ""
    answered_by: Mapping[str, int] = field(default_factory=dict)
    by_count: Mapping[int, Mapping[str, int]] = field(default_factory=dict)
    reliability: MeasuredErrorRates | None = None
    frames: FrameRange | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return all metrics as JSON values."""
        values = asdict(self)
        values["frames"] = self.frames and self.frames.model_dump()
        if self.reliability is not None:
            values["reliability"]["rates"] = self.reliability.rates.model_dump()
        return values
