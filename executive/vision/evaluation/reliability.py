"""Error rates of a detector with their bounds.

The bounds are exact and one-sided: a worse rate would show so few events in at most one of twenty
measurements (Clopper and Pearson, Biometrika 26 (1934), 404-413; Garwood, Biometrika 28 (1936), 437-442).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy.special import betaincinv, gammaincinv

from executive.vision.envelope.measurement import Rates

CONFIDENCE = 0.95
"""Probability with which the true rate lies below its bound."""
MAX_SHARE = 0.99
"""Largest share that is stored: a share of 1 would make every look worthless."""
MIN_JITTER = 0.01
"""Smallest jitter that is stored [pixel]: a jitter of 0 would make one look exact."""


@dataclass(frozen=True)
class Count:
    """A rate that was measured by counting.

    Attributes:
        events: How often it happened.
        trials: Of how many.
        bound: Upper 95 % bound of the rate.
    """

    events: int
    trials: int
    bound: float


@dataclass(frozen=True)
class MeasuredReliability:
    """How a detector errs on objects in full view, for `executive.messages.Reliability`.

    Attributes:
        misses: Objects that it overlooked, of those in full view.
        confused: Objects that it gave a wrong class, of those it found.
        invented: Objects that are not there, per look.
        jitter: Standard deviation of the random error of a box's centre, along each axis [pixel].
        repeated: Share of the errors that a second look from the same pose repeats.
        bias: Standard deviation of the systematic error of a position, along each axis [m].
    """

    misses: Count
    confused: Count
    invented: Count
    jitter: float
    repeated: float
    bias: float

    @staticmethod
    def of(
        *,
        whole: int,
        overlooked: int,
        confused: int,
        invented: int,
        looks: int,
        jitter: float,
        repeated: float,
        bias: float,
    ) -> MeasuredReliability:
        """Return the figures; `whole` counts the objects in full view, `looks` the answers."""
        return MeasuredReliability(
            _count_share(overlooked, whole), _count_share(confused, whole - overlooked),
            Count(invented, looks, float(gammaincinv(invented + 1, CONFIDENCE)) / looks), jitter,
            repeated, bias,
        )  # fmt: skip

    @property
    def rates(self) -> Rates:
        """Rates for the ledger: upper bounds, rounded up."""
        return Rates(
            misses=min(round_up(self.misses.bound), MAX_SHARE),
            confused=min(round_up(self.confused.bound), MAX_SHARE),
            invented=round_up(self.invented.bound),
            jitter=max(round_up(self.jitter), MIN_JITTER),
            repeated=min(round_up(self.repeated), MAX_SHARE),
            bias=round_up(self.bias),
        )


def _count_share(events: int, trials: int) -> Count:
    """Return a share with its bound, which is 1 where nothing contradicts the worst."""
    bound = float(betaincinv(events + 1, trials - events, CONFIDENCE)) if events < trials else 1.0
    return Count(events, trials, bound)


def round_up(value: float, digits: int = 2) -> float:
    """Return `value` with so many significant digits, rounded up: a bound must not get smaller."""
    if value <= 0:
        return 0.0
    places = digits - 1 - math.floor(math.log10(value))
    return round(math.ceil(round(value * 10**places, 6)) / 10**places, max(places, 0))
