"""Comparison of two missions by pairs of runs with the same seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from executive.campaign.results.intervals import FloatArray, compute_bootstrap_interval, divide_sums
from executive.campaign.results.rows import RunRow
from executive.campaign.results.sweep_summary import SECONDS_PER_HOUR


@dataclass(frozen=True)
class RunPair:
    """Runs of the missions A and B with the same seed."""

    seed: int
    a: RunRow
    b: RunRow

    @property
    def is_changed(self) -> bool:
        """True if the runs differ in status, reason or audit."""
        return (self.a.status, self.a.problem, self.a.audit) != (self.b.status, self.b.problem, self.b.audit)


@dataclass(frozen=True)
class Difference:
    """Difference of a metric between two missions, with a 95 % bootstrap interval over the pairs.

    Attributes:
        metric: Name of the metric, with its unit.
        a, b: Values of the missions; None without data.
        difference: Value of B minus value of A; None without data.
        low, high: Limits of the interval of the difference; None with fewer than two pairs.
    """

    metric: str
    a: float | None = None
    b: float | None = None
    difference: float | None = None
    low: float | None = None
    high: float | None = None

    @property
    def is_significant(self) -> bool:
        """True if the interval excludes 0."""
        return self.low is not None and self.high is not None and (self.low > 0 or self.high < 0)


def pair_runs(runs_a: Sequence[RunRow], runs_b: Sequence[RunRow]) -> list[RunPair]:
    """Return the pairs of runs with the same seed.

    A run is omitted if the other mission has no run with the same seed.
    """
    runs_by_seed = {run.seed: run for run in runs_b}
    return [RunPair(run.seed, run, runs_by_seed[run.seed]) for run in runs_a if run.seed in runs_by_seed]


def compute_differences(pairs: Sequence[RunPair]) -> list[Difference]:
    """Return the differences in success rate, throughput, and robot time.

    Success rate and throughput are computed from all pairs, the robot time from the pairs in which both runs
    succeed.
    """
    both_succeeded = [pair for pair in pairs if pair.a.is_success and pair.b.is_success]
    successes = [(pair.a.is_success, 1, pair.b.is_success, 1) for pair in pairs]
    throughputs = [(*_get_throughput_terms(pair.a), *_get_throughput_terms(pair.b)) for pair in pairs]
    times = [(pair.a.robot_time_s, 1, pair.b.robot_time_s, 1) for pair in both_succeeded]
    return [
        _estimate_difference("success rate", successes),
        _estimate_difference("objects per hour", throughputs),
        _estimate_difference("robot time if both runs succeed [s]", times),
    ]


def _get_throughput_terms(run: RunRow) -> tuple[float, float]:
    """Return the number of placed objects, and the robot time [h]."""
    return run.items.placed, run.robot_time_s / SECONDS_PER_HOUR


def _estimate_difference(metric: str, terms: Sequence[tuple[float, float, float, float]]) -> Difference:
    """Return the difference of two ratios of sums.

    Args:
        metric: Name of the metric.
        terms: Numerator and denominator of the ratio of A, and of the ratio of B, for each pair.
    """
    columns = np.array(terms, dtype=float).reshape(-1, 4).T
    if not (columns[1].sum() and columns[3].sum()):
        return Difference(metric)
    a, b = columns[0].sum() / columns[1].sum(), columns[2].sum() / columns[3].sum()
    interval = compute_bootstrap_interval(_subtract_ratios, tuple(columns))
    return Difference(metric, float(a), float(b), float(b - a), *interval)


def _subtract_ratios(
    numerators_a: FloatArray, denominators_a: FloatArray,
    numerators_b: FloatArray, denominators_b: FloatArray, axis: int,
) -> FloatArray:  # fmt: skip
    """Return the ratios of B minus the ratios of A; each ratio divides two sums along an axis."""
    return divide_sums(numerators_b, denominators_b, axis) - divide_sums(numerators_a, denominators_a, axis)
