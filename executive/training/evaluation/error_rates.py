"""Error rates of a detector with their bounds.

The bounds are exact one-sided 95 % confidence limits (Clopper and Pearson, Biometrika 26 (1934), 404-413;
Garwood, Biometrika 28 (1936), 437-442).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy.special import betaincinv, gammaincinv

from executive.perception.envelope.measurement import StoredErrorRates

CONFIDENCE = 0.95
"""Confidence level of the bounds."""
MAX_SHARE = 0.99
"""Largest share that is stored: a share of 1 would make every look worthless."""
MIN_JITTER = 0.01
"""Smallest jitter that is stored [pixel]: a jitter of 0 would make one look exact."""


@dataclass(frozen=True)
class CountedRate:
    """A rate that was measured by counting.

    Attributes:
        events: Number of events.
        trials: Number of trials.
        bound: Upper 95 % bound of the rate.
    """

    events: int
    trials: int
    bound: float

    @staticmethod
    def share(events: int, trials: int) -> CountedRate:
        """Return the share of the trials that are events; its bound is 1 if every trial is one."""
        bound = float(betaincinv(events + 1, trials - events, CONFIDENCE)) if events < trials else 1.0
        return CountedRate(events, trials, bound)

    @staticmethod
    def per_trial(events: int, trials: int) -> CountedRate:
        """Return the mean number of events in a trial, which may hold several."""
        return CountedRate(events, trials, float(gammaincinv(events + 1, CONFIDENCE)) / trials)


@dataclass(frozen=True)
class MeasuredErrorRates:
    """Measured error rates of a detector on objects in full view.

    Attributes:
        miss_rate: Rate of missed objects in full view.
        confusion_rate: Rate of wrong classes among the found objects in full view.
        false_detections: Rate of false detections per look.
        jitter: Standard deviation of the random error of a box's centre, along each axis [pixel].
        repeated: Laplace estimate of the share of the errors that a second look from the same pose repeats.
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
        """Rates for the ledger, rounded up: the bounds, the repeated share and the standard deviations."""
        return StoredErrorRates(
            miss_rate=min(round_up(self.miss_rate.bound), MAX_SHARE),
            confusion_rate=min(round_up(self.confusion_rate.bound), MAX_SHARE),
            false_detections=round_up(self.false_detections.bound),
            jitter=max(round_up(self.jitter), MIN_JITTER),
            repeated=min(round_up(self.repeated), MAX_SHARE),
            bias=round_up(self.bias),
        )


def round_up(value: float, digits: int = 2) -> float:
    """Return `value` rounded up to `digits` significant digits: a bound must not get smaller."""
    if value <= 0:
        return 0.0
    places = digits - 1 - math.floor(math.log10(value))
    return round(math.ceil(round(value * 10**places, 6)) / 10**places, max(places, 0))
