"""Summary of a sweep: success, objects per hour, agreement, phases and failures of each variant."""

from __future__ import annotations

import statistics
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from executive.campaign.pool import MAX_CRASHES
from executive.campaign.results.intervals import Estimate, estimate_ratio, estimate_share
from executive.campaign.results.rows import PhaseRow, RunRow

SECONDS_PER_HOUR = 3600.0
"""Number of seconds per hour [s]."""
RepeatCommand = Callable[[RunRow], str]
"""Function that returns the command line that repeats a run."""


@dataclass(frozen=True)
class Spread:
    """Minimum, median, mean and maximum of a quantity."""

    min: float
    median: float
    mean: float
    max: float

    @staticmethod
    def from_values(values: Sequence[float]) -> Spread:
        """Return the spread of the values; 0 without values."""
        values = values or [0.0]
        return Spread(min(values), statistics.median(values), statistics.fmean(values), max(values))


@dataclass(frozen=True)
class PhaseSummary:
    """A skill in all runs of a variant.

    Attributes:
        phase: Name of the skill.
        activations, failures: Number of activations, and number of failed activations.
        robot_time_s: Mean time per run [s].
    """

    phase: str
    activations: int
    failures: int
    robot_time_s: float


@dataclass(frozen=True)
class FailureGroup:
    """Runs with the same problem.

    Attributes:
        status, reason, node: Status, reason and node of the runs; `disagreement` is the reason of a run in
            which only the audit contradicts the ledger.
        seeds: Seeds of the runs.
        message, run, repeat: Message, run directory, and command that repeats the run; all of the first run.
    """

    status: str
    reason: str
    node: str
    seeds: tuple[int, ...]
    message: str
    run: str
    repeat: str


@dataclass(frozen=True)
class VariantSummary:
    """Statistics of the runs with equal values of the varied keys.

    Attributes:
        variant: Values of the varied params and keys of the cell, by name.
        runs, succeeded, crashed: Number of runs, successful runs, and runs whose process died twice.
        success: Share of the successful runs.
        right, objects: Number of objects in a permitted bin, and of all objects; 0 without ground truth.
        right_share: Share of the objects in a permitted bin.
        agreement: Share of the runs in which the audit confirms the ledger.
        objects_per_hour: Placed objects per hour of robot time.
        robot_time_s, wall_time_s: Duration of a run on the clock of the run and on a wall clock [s].
        motions, ahead: Number of planned motions, and number of motions that were planned ahead.
        waited_s: Time for which skills waited for plans, of all runs [s].
        phases: The skills, by decreasing time.
        failures: The problems, by decreasing number of runs.
    """

    variant: Mapping[str, str]
    runs: int
    succeeded: int
    crashed: int
    success: Estimate
    right: int
    objects: int
    right_share: Estimate
    agreement: Estimate
    objects_per_hour: Estimate
    robot_time_s: Spread
    wall_time_s: Spread
    motions: int
    ahead: int
    waited_s: float
    phases: tuple[PhaseSummary, ...]
    failures: tuple[FailureGroup, ...]


def summarize_runs(
    runs: Sequence[RunRow], phases: Sequence[PhaseRow], make_repeat_command: RepeatCommand
) -> list[VariantSummary]:
    """Return the summary of each variant, in the order of the jobs."""
    runs_by_variant: dict[tuple[tuple[str, str], ...], list[RunRow]] = defaultdict(list)
    for run in runs:
        runs_by_variant[tuple(run.variant.items())].append(run)
    phases_by_job: dict[int, list[PhaseRow]] = defaultdict(list)
    for phase in phases:
        phases_by_job[phase.job].append(phase)
    return [
        _summarize_variant(
            group, [row for run in group for row in phases_by_job[run.job]], make_repeat_command
        )
        for group in runs_by_variant.values()
    ]


def _summarize_variant(
    runs: Sequence[RunRow], phases: Sequence[PhaseRow], make_repeat_command: RepeatCommand
) -> VariantSummary:
    """Return the summary of runs of one variant."""
    audits = [run.audit for run in runs if run.audit is not None]
    right = sum(audit.right for audit in audits)
    total = sum(audit.right + audit.wrong_bin + audit.left + audit.elsewhere for audit in audits)
    success_count = sum(run.is_success for run in runs)
    hours = [run.robot_time_s / SECONDS_PER_HOUR for run in runs]
    return VariantSummary(
        variant=runs[0].variant,
        runs=len(runs),
        succeeded=success_count,
        crashed=sum(run.crashes == MAX_CRASHES for run in runs),
        success=estimate_share(success_count, len(runs)),
        right=right,
        objects=total,
        right_share=estimate_share(right, total),
        agreement=estimate_share(sum(audit.agrees for audit in audits), len(audits)),
        objects_per_hour=estimate_ratio([run.items.placed for run in runs], hours),
        robot_time_s=Spread.from_values([run.robot_time_s for run in runs]),
        wall_time_s=Spread.from_values([run.wall_time_s for run in runs]),
        motions=sum(run.planning.motions for run in runs),
        ahead=sum(run.planning.ahead for run in runs),
        waited_s=sum(run.planning.waited_s for run in runs),
        phases=_summarize_phases(phases, len(runs)),
        failures=_group_failures(runs, make_repeat_command),
    )


def _summarize_phases(phases: Sequence[PhaseRow], run_count: int) -> tuple[PhaseSummary, ...]:
    """Return the summary of each skill, by decreasing time."""
    rows_by_phase: dict[str, list[PhaseRow]] = defaultdict(list)
    for phase in phases:
        rows_by_phase[phase.phase].append(phase)
    summaries = [
        PhaseSummary(
            name,
            sum(row.activations for row in rows),
            sum(row.failures for row in rows),
            sum(row.robot_time_s for row in rows) / run_count,
        )
        for name, rows in rows_by_phase.items()
    ]
    return tuple(sorted(summaries, key=lambda summary: -summary.robot_time_s))


def _group_failures(runs: Sequence[RunRow], make_repeat_command: RepeatCommand) -> tuple[FailureGroup, ...]:
    """Return the runs with a problem, grouped by status, reason and node, by decreasing number of runs."""
    groups: dict[tuple[str, str, str], list[RunRow]] = defaultdict(list)
    for run in runs:
        if run.has_problem:
            groups[run.status, "disagreement" if run.is_success else run.reason, run.node].append(run)
    failures = []
    for (status, reason, node), group in groups.items():
        first, seeds = group[0], tuple(run.seed for run in group)
        message, repeat = first.message or first.disagreement, make_repeat_command(first)
        failures.append(FailureGroup(status, reason, node, seeds, message, first.run, repeat))
    return tuple(sorted(failures, key=lambda failure: -len(failure.seeds)))
