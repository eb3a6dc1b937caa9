"""Statistics of sweeps: summaries of variants with confidence intervals, and differences of two missions."""

from __future__ import annotations

import statistics
import warnings
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from executive.campaign.results import RunRow, SkillRow, SweepSettings
from executive.record.timeline import PlanningTotals

FloatArray = NDArray[np.float64]
"""Array of floats with 64 bits."""
RESAMPLE_COUNT = 2000
"""Number of bootstrap resamples."""
BOOTSTRAP_SEED = 0
"""Seed of the bootstrap resamples; a fixed seed makes a summary reproducible."""
SECONDS_PER_HOUR = 3600.0
"""Number of seconds per hour [s]."""


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


@dataclass(frozen=True)
class SummaryStatistics:
    """Minimum, median, mean and maximum of a quantity."""

    min: float
    median: float
    mean: float
    max: float

    @staticmethod
    def from_values(values: Sequence[float]) -> SummaryStatistics:
        """Return the statistics of the values, of which there must be at least one."""
        mean = statistics.fmean(values)
        return SummaryStatistics(min(values), statistics.median(values), mean, max(values))


@dataclass(frozen=True)
class SkillSummary:
    """Number and time of the activations of one skill in all runs of a variant.

    Attributes:
        skill: Name of the skill.
        activations, failed_activations: Number of activations, and number of failed activations.
        mean_robot_time_s: Mean time per run [s].
    """

    skill: str
    activations: int
    failed_activations: int
    mean_robot_time_s: float


@dataclass(frozen=True)
class FailureGroup:
    """Runs with the same problem.

    Attributes:
        status, reason, node: Status, reason and node of the runs; the reason is `disagreement` if a run
            succeeded but its audit contradicts the ledger.
        seeds: Seeds of the runs.
        message: Message of the first run.
        run_directory: Path of the directory of the first run, or "".
        repeat_command: Command line that repeats the first run.
    """

    status: str
    reason: str
    node: str
    seeds: tuple[int, ...]
    message: str
    run_directory: str
    repeat_command: str


@dataclass(frozen=True)
class VariantSummary:
    """Statistics of the runs with equal values of the varied keys.

    Attributes:
        variant: Values of the varied params and keys of the cell, by name.
        success: Proportion of the successful runs.
        correct_objects: Proportion of objects in a permitted bin; the denominator is 0 without ground truth.
        agreement: Proportion of the runs in which the audit confirms the ledger.
        objects_per_hour: Placed objects per hour of robot time.
        robot_time_s, wall_time_s: Duration of a run on the clock of the run, and on a wall clock [s].
        planning: Statistics of motion planning, summed over the runs.
        skills: The skills, by decreasing time.
        failure_groups: Groups of runs with the same problem, by decreasing number of runs.
    """

    variant: Mapping[str, str]
    success: Estimate
    correct_objects: Estimate
    agreement: Estimate
    objects_per_hour: Estimate
    robot_time_s: SummaryStatistics
    wall_time_s: SummaryStatistics
    planning: PlanningTotals
    skills: tuple[SkillSummary, ...]
    failure_groups: tuple[FailureGroup, ...]


@dataclass(frozen=True)
class SweepResults:
    """Results of a sweep.

    Attributes:
        side: `A` or `B` in a comparison, else "".
        settings: Settings of the sweep.
        runs: Rows of the runs.
        summaries: Summary of each variant.
    """

    side: str
    settings: SweepSettings
    runs: Sequence[RunRow]
    summaries: Sequence[VariantSummary]

    @property
    def is_incomplete(self) -> bool:
        """True if runs are missing."""
        return len(self.runs) < self.settings.run_count


def summarize_runs(
    runs: Sequence[RunRow], skills: Sequence[SkillRow], settings: SweepSettings
) -> list[VariantSummary]:
    """Return the summary of each variant, in the order of the jobs."""
    runs_by_variant: dict[tuple[tuple[str, str], ...], list[RunRow]] = defaultdict(list)
    for run in runs:
        runs_by_variant[tuple(run.variant.items())].append(run)
    skills_by_run: dict[int, list[SkillRow]] = defaultdict(list)
    for row in skills:
        skills_by_run[row.run_index].append(row)
    return [
        _summarize_variant(group, [row for run in group for row in skills_by_run[run.run_index]], settings)
        for group in runs_by_variant.values()
    ]


def _summarize_variant(
    runs: Sequence[RunRow], skills: Sequence[SkillRow], settings: SweepSettings
) -> VariantSummary:
    """Return the summary of the runs of one variant, of which there must be at least one."""
    audits = [run.audit for run in runs if run.audit]
    plannings = [astuple(run.planning) for run in runs]
    object_count = sum(audit.right + audit.wrong_bin + audit.left + audit.elsewhere for audit in audits)
    hours = [run.robot_time_s / SECONDS_PER_HOUR for run in runs]
    return VariantSummary(
        variant=runs[0].variant,
        success=estimate_proportion(sum(run.is_success for run in runs), len(runs)),
        correct_objects=estimate_proportion(sum(audit.right for audit in audits), object_count),
        agreement=estimate_proportion(sum(audit.agrees for audit in audits), len(audits)),
        objects_per_hour=estimate_ratio([run.items.placed for run in runs], hours),
        robot_time_s=SummaryStatistics.from_values([run.robot_time_s for run in runs]),
        wall_time_s=SummaryStatistics.from_values([run.wall_time_s for run in runs]),
        planning=PlanningTotals(*map(sum, zip(*plannings, strict=True))),
        skills=_summarize_skills(skills, len(runs)),
        failure_groups=_group_failures(runs, settings),
    )


def _summarize_skills(skills: Sequence[SkillRow], run_count: int) -> tuple[SkillSummary, ...]:
    """Return the summary of each skill, by decreasing time."""
    summaries = []
    for name in dict.fromkeys(row.skill for row in skills):
        rows = [row for row in skills if row.skill == name]
        activations = sum(row.activations for row in rows)
        failed_activations = sum(row.failed_activations for row in rows)
        time = sum(row.robot_time_s for row in rows) / run_count
        summaries.append(SkillSummary(name, activations, failed_activations, time))
    return tuple(sorted(summaries, key=lambda summary: -summary.mean_robot_time_s))


def _group_failures(runs: Sequence[RunRow], settings: SweepSettings) -> tuple[FailureGroup, ...]:
    """Return the runs with a problem, grouped by status, reason and node, by decreasing number of runs."""
    groups: dict[tuple[str, str, str], list[RunRow]] = defaultdict(list)
    for run in runs:
        if run.problem:
            groups[run.status, run.problem, run.node].append(run)
    failures = []
    for problem, group in groups.items():
        first = group[0]
        seeds = tuple(run.seed for run in group)
        command = settings.make_repeat_command(first)
        failures.append(FailureGroup(*problem, seeds, first.explanation, first.run_directory, command))
    return tuple(sorted(failures, key=lambda failure: -len(failure.seeds)))


def estimate_proportion(successes: int, total: int) -> Estimate:
    """Return the proportion successes / total with its Wilson score interval."""
    if total == 0:
        return Estimate(successes, total)
    # The import takes 0.5 s, for which the refusal of wrong inputs must not wait.
    from scipy.stats import binomtest

    interval = binomtest(successes, total).proportion_ci(method="wilson")
    return Estimate(successes, total, successes / total, float(interval.low), float(interval.high))


def estimate_ratio(numerators: Sequence[float], denominators: Sequence[float]) -> Estimate:
    """Return the ratio of two sums over runs, with its percentile bootstrap interval over the runs.

    The ratio of a single run has no interval.
    """
    numerator = sum(numerators)
    denominator = sum(denominators)
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
    # The import takes 0.5 s, for which the refusal of wrong inputs must not wait.
    from scipy.stats import bootstrap

    # scipy warns if all resamples are equal or if a denominator is 0.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        interval = bootstrap(
            samples, compute_statistic, paired=True, vectorized=True, batch=100,
            n_resamples=RESAMPLE_COUNT, method="percentile", rng=np.random.default_rng(BOOTSTRAP_SEED),
        ).confidence_interval  # fmt: skip
    return float(interval.low), float(interval.high)


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
    """Return the pairs of runs with the same seed; a run without another run of its seed is omitted."""
    runs_by_seed = {run.seed: run for run in runs_b}
    return [RunPair(run.seed, run, runs_by_seed[run.seed]) for run in runs_a if run.seed in runs_by_seed]


def compute_differences(pairs: Sequence[RunPair]) -> list[Difference]:
    """Return the differences in success rate, throughput, and robot time.

    Success rate and throughput are computed from all pairs, the robot time from the pairs in which both runs
    succeed.
    """
    both_succeeded = [pair for pair in pairs if pair.a.is_success and pair.b.is_success]
    return [
        _estimate_difference("success rate", pairs, lambda run: (run.is_success, 1)),
        _estimate_difference(
            "objects per hour", pairs, lambda run: (run.items.placed, run.robot_time_s / SECONDS_PER_HOUR)
        ),
        _estimate_difference(
            "robot time if both runs succeed [s]", both_succeeded, lambda run: (run.robot_time_s, 1)
        ),
    ]


def _estimate_difference(
    metric: str, pairs: Sequence[RunPair], get_terms: Callable[[RunRow], tuple[float, float]]
) -> Difference:
    """Return the difference of two ratios of sums; `get_terms` returns numerator and denominator of a run."""

    def subtract_ratios(*columns: FloatArray, axis: int) -> FloatArray:
        ratio_of_a = divide_sums(columns[0], columns[1], axis)
        return divide_sums(columns[2], columns[3], axis) - ratio_of_a

    terms = [(*get_terms(pair.a), *get_terms(pair.b)) for pair in pairs]
    columns = np.array(terms, dtype=float).reshape(-1, 4).T
    if not columns[1::2].sum(axis=1).all():
        return Difference(metric)
    a, b = divide_sums(columns[::2], columns[1::2], axis=1).tolist()
    return Difference(metric, a, b, b - a, *compute_bootstrap_interval(subtract_ratios, tuple(columns)))
