"""Summary of a sweep: success, objects per hour, agreement, skills and failures of each variant."""

from __future__ import annotations

import statistics
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, dataclass

from executive.campaign.results.intervals import Estimate, estimate_proportion, estimate_ratio
from executive.campaign.results.rows import ItemRow, RunRow, SkillRow, SweepSettings
from executive.record.timeline.timeline import PlanningTotals

SECONDS_PER_HOUR = 3600.0
"""Number of seconds per hour [s]."""
RepeatCommandFactory = Callable[[RunRow], str]
"""Function that returns the command line that repeats a run."""


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
        median, mean = statistics.median(values), statistics.fmean(values)
        return SummaryStatistics(min(values), median, mean, max(values))


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
        runs, items: Rows of the runs and of the items.
        summaries: Summary of each variant.
        planned_run_count: Number of runs of a complete sweep.
    """

    side: str
    settings: SweepSettings
    runs: Sequence[RunRow]
    items: Sequence[ItemRow]
    summaries: Sequence[VariantSummary]
    planned_run_count: int

    @property
    def is_incomplete(self) -> bool:
        """True if runs are missing."""
        return len(self.runs) < self.planned_run_count


def summarize_runs(
    runs: Sequence[RunRow], skills: Sequence[SkillRow], make_repeat_command: RepeatCommandFactory
) -> list[VariantSummary]:
    """Return the summary of each variant, in the order of the jobs."""
    runs_by_variant: dict[tuple[tuple[str, str], ...], list[RunRow]] = defaultdict(list)
    for run in runs:
        runs_by_variant[tuple(run.variant.items())].append(run)
    return [_summarize_variant(group, skills, make_repeat_command) for group in runs_by_variant.values()]


def _summarize_variant(
    runs: Sequence[RunRow], skills: Sequence[SkillRow], make_repeat_command: RepeatCommandFactory
) -> VariantSummary:
    """Return the summary of the runs of one variant; `skills` contains the rows of all variants."""
    audits, plannings = [run.audit for run in runs if run.audit], [run.planning for run in runs]
    object_count = sum(audit.right + audit.wrong_bin + audit.left + audit.elsewhere for audit in audits)
    run_indices = {run.run_index for run in runs}
    hours = [run.robot_time_s / SECONDS_PER_HOUR for run in runs]
    return VariantSummary(
        variant=runs[0].variant,
        success=estimate_proportion(sum(run.is_success for run in runs), len(runs)),
        correct_objects=estimate_proportion(sum(audit.right for audit in audits), object_count),
        agreement=estimate_proportion(sum(audit.agrees for audit in audits), len(audits)),
        objects_per_hour=estimate_ratio([run.items.placed for run in runs], hours),
        robot_time_s=SummaryStatistics.from_values([run.robot_time_s for run in runs]),
        wall_time_s=SummaryStatistics.from_values([run.wall_time_s for run in runs]),
        planning=PlanningTotals(*map(sum, zip(*map(astuple, plannings), strict=True))),
        skills=_summarize_skills([row for row in skills if row.run_index in run_indices], len(runs)),
        failure_groups=_group_failures(runs, make_repeat_command),
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


def _group_failures(runs: Sequence[RunRow], make_command: RepeatCommandFactory) -> tuple[FailureGroup, ...]:
    """Return the runs with a problem, grouped by status, reason and node, by decreasing number of runs."""
    groups: dict[tuple[str, str, str], list[RunRow]] = defaultdict(list)
    for run in runs:
        if run.problem:
            groups[run.status, run.problem, run.node].append(run)
    failures = []
    for (status, reason, node), group in groups.items():
        first, seeds = group[0], tuple(run.seed for run in group)
        message, directory, command = first.explanation, first.run_directory, make_command(first)
        failures.append(FailureGroup(status, reason, node, seeds, message, directory, command))
    return tuple(sorted(failures, key=lambda failure: -len(failure.seeds)))
