"""Upper confidence bounds of what was counted: how bad a rate may be, given how often it was seen.

Both are exact and one-sided: a worse rate would show so few events in at most one of twenty
measurements. Sources: Clopper and Pearson, Biometrika 26 (1934), 404-413; Garwood, Biometrika 28
(1936), 437-442.
"""

from __future__ import annotations

import math
from collections.abc import Callable

DOUBT = 0.05
"""Chance that the true rate is above the bound."""
HALVINGS = 60
"""Bisections of the range: more than a float can tell apart."""


def share_bound(events: int, trials: int) -> float:
    """Return the upper bound of the chance of what happened in `events` of `trials`; 1 for no trial."""
    if events >= trials:
        return 1.0

    def at_most(chance: float) -> float:
        logs = (
            math.lgamma(trials + 1) - math.lgamma(k + 1) - math.lgamma(trials - k + 1)
            + k * math.log(chance) + (trials - k) * math.log1p(-chance)
            for k in range(events + 1)
        )  # fmt: skip
        return sum(math.exp(log) for log in logs)

    return _where_unlikely(at_most, 1.0)


def rate_bound(events: int, looks: int) -> float:
    """Return the upper bound of the mean number of events per look, of which `looks` had `events`.

    Raises:
        ValueError: There was no look.
    """
    if looks < 1:
        raise ValueError("a rate per look needs at least one look")

    def at_most(mean: float) -> float:
        return sum(math.exp(k * math.log(mean) - mean - math.lgamma(k + 1)) for k in range(events + 1))

    # Twice the count and five more is above the bound for every count.
    return _where_unlikely(at_most, 2.0 * events + 5.0) / looks


def rounded_up(value: float, digits: int = 2) -> float:
    """Return `value` with so many significant digits, rounded up: a bound must not get smaller."""
    if value <= 0:
        return 0.0
    places = digits - 1 - math.floor(math.log10(value))
    return round(math.ceil(round(value * 10**places, 6)) / 10**places, max(places, 0))


def _where_unlikely(at_most: Callable[[float], float], high: float) -> float:
    """Return where in 0 to `high` the falling function `at_most` is `DOUBT`."""
    low = 0.0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if at_most(middle) > DOUBT else (low, middle)
    return high
