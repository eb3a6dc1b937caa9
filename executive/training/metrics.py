"""Metrics of an evaluation of a detector, with exact one-sided upper confidence bounds of error rates.

Sources: Clopper and Pearson, Biometrika 26 (1934), 404-413; Garwood, Biometrika 28 (1936), 437-442.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from scipy.special import betaincinv, gammaincinv

from executive.perception.envelope import FrameRange, StoredErrorRates

NO_OBJECT = "nothing"
"""Detected class of a missed object, and true class of a false detection, in a confusion matrix."""
CONFIDENCE_LEVEL = 0.95
"""Confidence level of the upper bounds of error rates."""
MAX_PROPORTION = 0.99
"""Maximum stored proportion: with a miss rate of 1, a frame would give no information."""
MIN_JITTER = 0.01
"""Minimum stored jitter [pixel]: with a jitter of 0, a position from one frame would count as exact."""


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
class CountedRate:
    """Measured frequency of an event, with a confidence bound.

    Attributes:
        events: Number of events.
        trials: Number of trials.
        bound: Upper 95 % confidence bound of the frequency.
    """

    events: int
    trials: int
    bound: float

    @staticmethod
    def estimate_proportion(events: int, trials: int) -> CountedRate:
        """Return the proportion of trials with an event; the bound is 1 if all trials have an event."""
        # The bound is a quantile of the beta distribution (Clopper and Pearson).
        bound = float(betaincinv(events + 1, trials - events, CONFIDENCE_LEVEL)) if events < trials else 1.0
        return CountedRate(events, trials, bound)

    @staticmethod
    def estimate_mean_count(events: int, trials: int) -> CountedRate:
        """Return the mean number of events per trial, which can exceed 1."""
        # The bound of the number of events is a quantile of the gamma distribution (Garwood).
        return CountedRate(events, trials, float(gammaincinv(events + 1, CONFIDENCE_LEVEL)) / trials)


@dataclass(frozen=True)
class MeasuredErrorRates:
    """Measured error rates of a detector.

    Attributes:
        miss_rate: Proportion of missed objects among the fully visible objects.
        confusion_rate: Proportion of wrong classes among the detected, fully visible objects.
        false_detections: Mean number of false detections per image.
        jitter: Standard deviation of the random error of a box's centre, along each axis [pixel].
        repeated: Laplace estimate of the fraction of errors that a second frame from the same pose repeats.
        bias: Standard deviation of the systematic error of a position, along each axis [m].
    """

    miss_rate: CountedRate
    confusion_rate: CountedRate
    false_detections: CountedRate
    jitter: float
    repeated: float
    bias: float

    @property
    def rates(self) -> StoredErrorRates:
        """Error rates for the ledger, rounded up; each `CountedRate` is replaced by its bound."""
        return StoredErrorRates(
            miss_rate=min(round_up(self.miss_rate.bound), MAX_PROPORTION),
            confusion_rate=min(round_up(self.confusion_rate.bound), MAX_PROPORTION),
            false_detections=round_up(self.false_detections.bound),
            jitter=max(round_up(self.jitter), MIN_JITTER),
            repeated=min(round_up(self.repeated), MAX_PROPORTION),
            bias=round_up(self.bias),
        )


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


def round_up(value: float, digits: int = 2) -> float:
    """Return `value` rounded up to `digits` significant digits, so that a rounded bound stays a bound."""
    if value <= 0:
        return 0.0
    places = digits - 1 - math.floor(math.log10(value))
    # The inner rounding removes floating-point errors, which `ceil` would round up.
    return round(math.ceil(round(value * 10**places, 6)) / 10**places, max(places, 0))
