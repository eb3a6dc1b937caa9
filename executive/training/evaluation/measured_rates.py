"""Error rates of a detector with exact one-sided upper confidence bounds.

Sources: Clopper and Pearson, Biometrika 26 (1934), 404-413; Garwood, Biometrika 28 (1936), 437-442.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy.special import betaincinv, gammaincinv

from executive.perception.envelope.measurement import StoredErrorRates

CONFIDENCE_LEVEL = 0.95
"""Confidence level of the upper bounds."""
MAX_PROPORTION = 0.99
"""Maximum stored proportion: with a miss rate of 1, a frame would give no information."""
MIN_JITTER = 0.01
"""Minimum stored jitter [pixel]: with a jitter of 0, a position from one frame would count as exact."""


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


def round_up(value: float, digits: int = 2) -> float:
    """Return `value` rounded up to `digits` significant digits, so that a rounded bound stays a bound."""
    if value <= 0:
        return 0.0
    places = digits - 1 - math.floor(math.log10(value))
    # The inner rounding removes floating-point errors, which `ceil` would round up.
    return round(math.ceil(round(value * 10**places, 6)) / 10**places, max(places, 0))
