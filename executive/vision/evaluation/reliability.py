"""Error rates of a detector, in the four figures that its section of a cell file states.

The bounds are exact and one-sided: a worse rate would show so few events in at most one of twenty
measurements (Clopper and Pearson, Biometrika 26 (1934), 404-413; Garwood, Biometrika 28 (1936), 437-442).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy.special import betaincinv, gammaincinv

CONFIDENCE = 0.95
"""Probability with which the true rate lies below its bound."""
MAX_SHARE = 0.99
"""Largest share that a cell file is advised to state: it takes none of 1."""
MIN_JITTER = 0.01
"""Smallest jitter that a cell file is advised to state [pixel]: it takes none of 0."""


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
        jitter: Standard deviation of the centre of a found box, along each axis [pixel of the frame].
    """

    misses: Count
    confused: Count
    invented: Count
    jitter: float

    @staticmethod
    def of(
        *, whole: int, overlooked: int, confused: int, invented: int, looks: int, jitter: float
    ) -> MeasuredReliability:
        """Return the figures; `whole` counts the objects in full view, `looks` the answers."""
        return MeasuredReliability(
            _count_share(overlooked, whole), _count_share(confused, whole - overlooked),
            Count(invented, looks, float(gammaincinv(invented + 1, CONFIDENCE)) / looks), jitter,
        )  # fmt: skip

    @property
    def stated(self) -> dict[str, float]:
        """Values for a cell file, by its keys: upper bounds, rounded up, in the range that it takes."""
        return {
            "misses": min(round_up(self.misses.bound), MAX_SHARE),
            "confused": min(round_up(self.confused.bound), MAX_SHARE),
            "invented": round_up(self.invented.bound),
            "jitter": max(round_up(self.jitter), MIN_JITTER),
        }

    def yaml(self) -> str:
        """Return the lines for the detector's section of a cell file, with what was counted."""
        remarks = (
            f"{self.misses.events} of {self.misses.trials} objects in full view; upper 95 % bound",
            f"{self.confused.events} of {self.confused.trials} found; upper 95 % bound",
            f"{self.invented.events} in {self.invented.trials} looks; upper 95 % bound",
            "pixels of the frame, as measured",
        )
        lines = [f"{key}: {value:g}" for key, value in self.stated.items()]
        width = max(map(len, lines))
        return "\n".join(f"{line:{width}}  # {remark}" for line, remark in zip(lines, remarks, strict=True))


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
