"""Statistics that campaigns report."""

from __future__ import annotations

import statistics
from collections.abc import Sequence


def wilson(successes: int, total: int) -> tuple[float, float]:
    """Return the 95 % Wilson score interval of a proportion; (0, 1) if nothing was counted."""
    if total == 0:
        return 0.0, 1.0
    from scipy.stats import binomtest  # half a second, which no worker of a sweep needs to spend

    interval = binomtest(successes, total).proportion_ci(method="wilson")
    return float(interval.low), float(interval.high)


def spread(values: Sequence[float]) -> dict[str, float]:
    """Return `least, median, mean, most` of `values`; all are 0 without values."""
    if not values:
        return dict.fromkeys(("least", "median", "mean", "most"), 0.0)
    return {
        "least": round(min(values), 3),
        "median": round(statistics.median(values), 3),
        "mean": round(statistics.fmean(values), 3),
        "most": round(max(values), 3),
    }
