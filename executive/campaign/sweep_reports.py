"""Reports of sweeps: tables, the page of a sweep or a comparison, unmet requirements, and JUnit XML."""

from __future__ import annotations

import operator
import os.path
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import RenderableType
from rich.table import Table

from executive.campaign.results import RunRow, describe_variant, encode_row
from executive.campaign.sweep_summary import (
    Difference,
    Estimate,
    FailureGroup,
    RunPair,
    SweepResults,
    VariantSummary,
)
from executive.errors import InputError, explain_os_errors
from executive.record.result import Audit
from executive.record.run_directory import RunDirectory, write_atomically
from executive.view.drawing import render_template
from executive.view.report import try_write_report
from executive.view.terminal import describe_end

MAX_LISTED_SEEDS = 10
"""Maximum number of seeds that are listed for a group of failures."""
MAX_LISTED_CHANGED_SEEDS = 20
"""Maximum number of seeds with a changed outcome that are listed."""
PAGE_NAME = "results.html"
"""Name of the page in the folder of a sweep or a comparison."""
MAX_LISTED_RUNS = 500
"""Maximum number of runs in a table of the page."""
MAX_REQUIREMENT_LENGTH = 1000
"""Maximum length of a requirement [characters]; each condition goes through all runs."""
METRICS = ("success", "agreement", "objects_per_hour")
"""Metrics of a variant: names of attributes of `VariantSummary` with the type `Estimate`."""
PERCENTILES: Mapping[str, float] = {"min": 0, "median": 50, "p50": 50, "p95": 95, "p99": 99, "max": 100}
"""Percentiles of a column over the runs, by name [%]."""
STATISTICS = ("mean", *PERCENTILES)
"""Names of the statistics of a column."""
OPERATORS = {">=": operator.ge, "<=": operator.le, ">": operator.gt, "<": operator.lt}
"""Comparisons by symbol."""
_EXAMPLE = RunRow(run_index=0, seed=0, status="", audit=Audit())
_COLUMNS = [name for name, value in encode_row(_EXAMPLE).items() if isinstance(value, (int, float))][2:]
"""Names of the numeric columns of a run, without `run_index` and `seed`."""
_CONDITION_PATTERN = re.compile(
    r"\s*(\w+)\s*(?:\(\s*(\w+)\s*\))?\s*([<>]=?)\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*"
)
"""Matches `success>=0.99` and `p95(robot_time_s)<20`."""


def render_summary(sweep: SweepResults) -> Iterator[RenderableType]:
    """Yield lines and a table with the summary of a sweep."""
    run_count = len(sweep.runs)
    success_count = sum(run.is_success for run in sweep.runs)
    if not sweep.is_incomplete:
        yield f"{success_count} of {run_count} runs succeeded"
    else:
        successes = f"; {success_count} of the {run_count} succeeded" if run_count else ""
        yield f"halted after {run_count} of {sweep.settings.run_count} runs{successes}"
    if not sweep.summaries:
        return
    table = Table(box=SIMPLE_HEAD, padding=(0, 1))
    table.add_column("(95 % interval)", no_wrap=True)
    for summary in sweep.summaries:
        table.add_column(describe_variant(summary.variant) or "all runs", justify="right")
    columns = list(map(_format_metrics, sweep.summaries))
    for name in dict.fromkeys(name for column in columns for name in column):
        table.add_row(name, *(column.get(name, "") for column in columns))
    yield table
    for summary in sweep.summaries:
        if summary.variant and summary.failure_groups:
            yield f"with {describe_variant(summary.variant)}:"
        for group in summary.failure_groups:
            yield from _list_failure_lines(group)


def _format_metrics(summary: VariantSummary) -> dict[str, str]:
    """Return the values of the metrics of a variant as text, by name."""
    objects = summary.correct_objects
    robot_time = summary.robot_time_s
    planning = summary.planning
    texts = {
        "success rate": _format_percentage(summary.success),
        "objects in the right bin": _format_percentage(objects),
        "number in the right bin": f"{objects.numerator} of {objects.denominator}",
        "ledger and audit agree": _format_percentage(summary.agreement),
        "objects per hour": _format_estimate(summary.objects_per_hour),
        "robot time, median [s]": f"{robot_time.median:.1f}",
        "robot time, range [s]": f"{robot_time.min:.1f} to {robot_time.max:.1f}",
        "wall time, median [s]": f"{summary.wall_time_s.median:.1f}",
        "motions planned ahead": f"{planning.ahead} of {planning.motions}",
        "waits for plans, sum [s]": f"{planning.waited_s:.1f}",
    }
    for skill in summary.skills:
        failures = f"{skill.failed_activations} of {skill.activations} failed"
        texts[f"{skill.skill}, per run [s]"] = f"{skill.mean_robot_time_s:.2f} ({failures})"
    return texts


def _list_failure_lines(group: FailureGroup) -> Iterator[str]:
    """Yield the lines about runs with the same problem."""
    seeds = ", ".join(map(str, group.seeds[:MAX_LISTED_SEEDS]))
    count = len(group.seeds)
    more = f" and {count - MAX_LISTED_SEEDS} more" if count > MAX_LISTED_SEEDS else ""
    runs_text = f"{count} run{'s' * (count > 1)}"
    yield f"{runs_text}: {describe_end(group.status, group.reason, group.node, group.message)}"
    yield f"  seeds {seeds}{more}; repeat the first: {group.repeat_command}"
    # A run whose process crashed has no run directory.
    if group.run_directory:
        yield f"  {group.run_directory}"


def _format_percentage(estimate: Estimate) -> str:
    """Return a proportion and its interval [%]."""
    if estimate.value is None or estimate.low is None or estimate.high is None:
        return "unknown"
    return f"{estimate.value:.2%} ({100 * estimate.low:.1f} to {100 * estimate.high:.1f})"


def _format_estimate(estimate: Estimate) -> str:
    """Return a value and its interval as integers."""
    if estimate.value is None:
        return "unknown"
    interval = "" if estimate.low is None else f" ({estimate.low:.0f} to {estimate.high:.0f})"
    return f"{estimate.value:.0f}{interval}"


def render_differences(
    differences: Sequence[Difference], changed_pairs: Sequence[RunPair], pair_count: int
) -> Iterator[RenderableType]:
    """Yield lines and a table with the differences, and with the seeds whose outcome changed."""
    table = Table("", "A", "B", "B minus A", "95 % interval", box=SIMPLE_HEAD, padding=(0, 1))
    for difference in differences:
        values = (difference.a, difference.b, difference.difference)
        limits = map(_format_number, (difference.low, difference.high))
        interval = "unknown" if difference.low is None else " to ".join(limits)
        table.add_row(difference.metric, *map(_format_number, values), interval)
    yield f"{pair_count} pairs of runs with the same seed"
    yield table
    yield f"{len(changed_pairs)} seeds with a different outcome"
    for pair in changed_pairs[:MAX_LISTED_CHANGED_SEEDS]:
        texts = [(run.status, run.problem, run.run_directory) for run in (pair.a, pair.b)]
        outcomes = [" ".join(filter(None, run_texts)) for run_texts in texts]
        yield f"  seed {pair.seed}: A {outcomes[0]}; B {outcomes[1]}"
    if len(changed_pairs) > MAX_LISTED_CHANGED_SEEDS:
        yield f"  and {len(changed_pairs) - MAX_LISTED_CHANGED_SEEDS} more; the page lists them"


def _format_number(value: float | None) -> str:
    """Return a number with four significant digits, or `unknown`."""
    return "unknown" if value is None else f"{value:.4g}"


def write_page(
    folder: Path, sweeps: Sequence[SweepResults],
    differences: Sequence[Difference] = (), changed_pairs: Sequence[RunPair] = (),
) -> Path:  # fmt: skip
    """Write the page of a sweep, or of a comparison of two sweeps, into `folder`; return its path.

    Args:
        folder: Folder of the sweep or comparison.
        sweeps: Results of the sweep, or of A and B.
        differences: Differences of the comparison.
        changed_pairs: Pairs of runs with different outcomes.

    Raises:
        InputError: The file cannot be written.
    """
    # Each table of the page has a column for each variant of each sweep.
    groups = []
    for sweep in sweeps:
        for summary in sweep.summaries:
            label = f"{sweep.side} {describe_variant(summary.variant)}".strip() or "all runs"
            groups.append({"label": label, "summary": summary})
    problems = [(sweep, run) for sweep in sweeps for run in sweep.runs if run.problem]
    path = folder / PAGE_NAME
    page = render_template(
        "results.html",
        sweeps=sweeps,
        groups=groups,
        differences=differences,
        changed_pairs=changed_pairs,
        problems=problems,
        limit=MAX_LISTED_RUNS,
        link=lambda run_directory: _make_link(run_directory, folder),
        describe_variant=describe_variant,
    )
    advice = "free some space, or make the folder writable"
    with explain_os_errors(InputError, f'cannot write the page "{path}"', advice):
        write_atomically(path, page)
    return path


def _make_link(run_directory: str, folder: Path) -> str:
    """Return the URL of the report in `run_directory`, relative to `folder`; "" without a report."""
    report = RunDirectory(Path(run_directory)).report
    return quote(os.path.relpath(report, folder)) if run_directory and report.is_file() else ""


def write_missing_reports(pairs: Sequence[RunPair]) -> None:
    """Write the report of each run that has a run directory without a report."""
    for run in (run for pair in pairs for run in (pair.a, pair.b)):
        if run.run_directory and not RunDirectory(Path(run.run_directory)).report.is_file():
            try_write_report(run.run_directory)


@dataclass(frozen=True)
class Condition:
    """Comparison of a metric with a number.

    Attributes:
        metric: Metric of a variant, or statistic of `column` over the runs.
        column: Column of the runs; "" for a metric of a variant.
        symbol: Key of `OPERATORS`.
        limit: Number with which the metric is compared.
    """

    metric: str
    column: str
    symbol: str
    limit: float

    def compute_value(self, rows: Sequence[Mapping[str, Any]], summary: VariantSummary) -> float | None:
        """Return the value of the metric for the encoded runs of a variant; None without data."""
        if not self.column:
            value: float | None = getattr(summary, self.metric).value
            return value
        numbers = [float(row[self.column]) for row in rows if self.column in row]
        if not numbers:
            return None
        percentile = PERCENTILES.get(self.metric)
        return float(np.mean(numbers) if percentile is None else np.percentile(numbers, percentile))

    def __str__(self) -> str:
        """Return the text of the condition."""
        metric = f"{self.metric}({self.column})" if self.column else self.metric
        return f"{metric}{self.symbol}{self.limit:g}"


def parse_requirement(text: str) -> tuple[Condition, ...]:
    """Parse conditions that are separated by `and`.

    Raises:
        InputError: The text is too long, or a part is no condition, or has an unknown metric, statistic or
            column.
    """
    if len(text) > MAX_REQUIREMENT_LENGTH:
        raise InputError(f"--require has {len(text)} characters; the maximum is {MAX_REQUIREMENT_LENGTH}")
    return tuple(map(_parse_condition, re.split(r"\band\b", text)))


def _parse_condition(text: str) -> Condition:
    """Return a condition from its text."""
    match = _CONDITION_PATTERN.fullmatch(text)
    if match is None:
        advice = "write for example success>=0.99 and p95(robot_time_s)<20"
        raise InputError(f'"{text.strip()}" is no comparison of a metric with a number; {advice}')
    metric = match[1]
    column = match[2] or ""
    if metric not in (STATISTICS if column else METRICS):
        statistics = ", ".join(f"{name}(COLUMN)" for name in STATISTICS)
        raise InputError(f'there is no metric "{metric}"; the metrics are {", ".join(METRICS)}, {statistics}')
    if column and column not in _COLUMNS:
        raise InputError(f'"{column}" is no numeric column of the runs; these are {", ".join(_COLUMNS)}')
    return Condition(metric, column, match[3], float(match[4]))


def describe_unmet_conditions(conditions: Sequence[Condition], sweep: SweepResults) -> list[str]:
    """Return a message for each condition that the runs of a variant do not meet."""
    messages = [] if sweep.summaries else ["no run has ended"]
    for summary in sweep.summaries:
        rows = [encode_row(run) for run in sweep.runs if run.variant == summary.variant]
        name = describe_variant(summary.variant)
        for condition in conditions:
            value = condition.compute_value(rows, summary)
            if value is None or not OPERATORS[condition.symbol](value, condition.limit):
                found = "no run has a value" if value is None else f"the value is {value:.6g}"
                messages.append(f"{condition} is not met{name and f' with {name}'}: {found}")
    return messages


def write_junit(path: Path, sweep: SweepResults) -> None:
    """Write the JUnit report: one test case per run, with the reason of a failure and a command to repeat it.

    A run with the status FAULT is an error. A run with the status FAILURE or INCOMPLETE is a failure, and so
    is a successful run whose audit contradicts the ledger.

    Raises:
        InputError: The file cannot be written.
    """
    advice = "name another file with --junit FILE"
    with explain_os_errors(InputError, f'cannot write the report "{path}"', advice):
        write_atomically(path, f"{render_template('junit.xml', sweep=sweep)}\n")
