"""The few figures that campaigns report."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence

Z_95 = 1.959964
"""Quantile of the normal distribution for a two-sided 95 % interval."""


def wilson(successes: int, total: int, z: float = Z_95) -> tuple[float, float]:
    """Return the Wilson score interval of a proportion; (0, 1) where nothing was counted.

    It stays inside 0..1 and is honest near both ends, where the usual interval has no width.
    Source: Wilson, J. Am. Stat. Assoc. 22 (1927), 209-212.
    """
    if total == 0:
        return 0.0, 1.0
    share = successes / total
    denominator = 1 + z * z / total
    centre = (share + z * z / (2 * total)) / denominator
    half = z / denominator * math.sqrt(share * (1 - share) / total + z * z / (4 * total * total))
    return max(0.0, centre - half), min(1.0, centre + half)


def spread(values: Sequence[float]) -> dict[str, float]:
    """Return `least, median, mean, most` of `values`; all zero where there are none."""
    if not values:
        return dict.fromkeys(("least", "median", "mean", "most"), 0.0)
    return {
        "least": round(min(values), 3),
        "median": round(statistics.median(values), 3),
        "mean": round(statistics.fmean(values), 3),
        "most": round(max(values), 3),
    }
