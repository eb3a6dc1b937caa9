"""Confidence intervals: Wilson intervals of proportions, and bootstrap intervals of ratios."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
"""Array of floats with 64 bits."""
RESAMPLE_COUNT = 2000
"""Number of bootstrap resamples."""
BOOTSTRAP_SEED = 0
"""Seed of the bootstrap resamples; a fixed seed makes a summary reproducible."""


@dataclass(frozen=True)
class Estimate:
    """A ratio with its 95 % confidence interval.

    Attributes:
        numerator, denominator: Terms of the ratio, for instance successful runs and all runs.
        value: The ratio; None if the denominator is 0.
        low, high: Limits of the interval; None if the data do not suffice.
    """

    numerator: float
    denominator: float
    value: float | None = None
    low: float | None = None
    high: float | None = None


def estimate_proportion(successes: int, total: int) -> Estimate:
    """Return the proportion successes / total with its Wilson score interval."""
    if total == 0:
        return Estimate(successes, total)
    from scipy.stats import binomtest  # Imported here, because the import takes 0.5 s.

    interval = binomtest(successes, total).proportion_ci(method="wilson")
    return Estimate(successes, total, successes / total, float(interval.low), float(interval.high))


def estimate_ratio(numerators: Sequence[float], denominators: Sequence[float]) -> Estimate:
    """Return the ratio of two sums over runs, with its percentile bootstrap interval over the runs.

    The ratio of a single run has no interval.
    """
    numerator, denominator = sum(numerators), sum(denominators)
    if not denominator:
        return Estimate(numerator, denominator)
    interval = compute_bootstrap_interval(divide_sums, (numerators, denominators))
    return Estimate(numerator, denominator, numerator / denominator, *interval)


def divide_sums(numerators: FloatArray, denominators: FloatArray, axis: int) -> FloatArray:
    """Return the ratios of the sums along an axis."""
    ratios: FloatArray = numerators.sum(axis) / denominators.sum(axis)
    return ratios


def compute_bootstrap_interval(
    compute_statistic: Callable[..., FloatArray], samples: Sequence[Sequence[float] | FloatArray]
) -> tuple[float, float] | tuple[None, None]:
    """Return the 95 % percentile bootstrap interval of a statistic of paired samples.

    Samples with fewer than two values have no interval: both limits are None. The BCa method is not used,
    because it is not defined for equal values; the percentile method returns [x, x] for equal values x.

    Args:
        compute_statistic: Function that returns the statistic of resamples along the axis `axis`.
        samples: Samples of equal length.
    """
    if len(samples[0]) < 2:
        return None, None
    from scipy.stats import bootstrap

    # scipy warns if all resamples are equal or if a denominator is 0.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        interval = bootstrap(
            samples, compute_statistic, paired=True, vectorized=True, batch=100,
            n_resamples=RESAMPLE_COUNT, method="percentile", rng=np.random.default_rng(BOOTSTRAP_SEED),
        ).confidence_interval  # fmt: skip
    return float(interval.low), float(interval.high)
