"""Requirement on the results of a sweep, and the report of its results in the JUnit XML format."""

from __future__ import annotations

import operator
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from executive.campaign.results import RunRow, describe_variant, encode_run
from executive.campaign.sweep_summary import RepeatCommandFactory, VariantSummary
from executive.errors import InputError
from executive.record.result import Audit
from executive.record.run_directory import convert_os_errors, write_atomically
from executive.view.text import replace_invalid_xml_characters

METRICS = ("success", "agreement", "objects_per_hour")
"""Metrics of a variant: names of attributes of `VariantSummary` with the type `Estimate`."""
PERCENTILES: Mapping[str, float] = {"min": 0, "median": 50, "p50": 50, "p95": 95, "p99": 99, "max": 100}
"""Percentiles of a column over the runs, by name [%]."""
STATISTICS = ("mean", *PERCENTILES)
"""Names of the statistics of a column."""
OPERATORS = {">=": operator.ge, "<=": operator.le, ">": operator.gt, "<": operator.lt}
"""Comparisons by symbol."""
_EXAMPLE = RunRow(run_index=0, seed=0, status="", audit=Audit())
_COLUMNS = [name for name, value in encode_run(_EXAMPLE).items() if isinstance(value, (int, float))][2:]
"""Names of the numeric columns of a run, without `run_index` and `seed`."""
_CONDITION_PATTERN = re.compile(
    r"\s*(\w+)\s*(?:\(\s*(\w+)\s*\))?\s*([<>]=?)\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*"
)
"""Matches `success>=0.99` and `p95(robot_time_s)<20`."""


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

    def compute_value(self, runs: Sequence[RunRow], summary: VariantSummary) -> float | None:
        """Return the value of the metric for the runs of a variant; None without data."""
        if not self.column:
            value: float | None = getattr(summary, self.metric).value
            return value
        columns = map(encode_run, runs)
        numbers = [float(each[self.column]) for each in columns if self.column in each]
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
        InputError: A part is no condition, or has an unknown metric, statistic or column.
    """
    return tuple(map(_parse_condition, re.split(r"\band\b", text)))


def describe_unmet_conditions(
    conditions: Sequence[Condition], runs: Sequence[RunRow], summaries: Sequence[VariantSummary]
) -> list[str]:
    """Return a message for each condition that the runs of a variant do not meet."""
    messages = [] if summaries else ["no run has ended"]
    for summary in summaries:
        variant_runs = [run for run in runs if run.variant == summary.variant]
        name = describe_variant(summary.variant)
        for condition in conditions:
            value = condition.compute_value(variant_runs, summary)
            if value is None or not OPERATORS[condition.symbol](value, condition.limit):
                found = "no run has a value" if value is None else f"the value is {value:.6g}"
                messages.append(f"{condition} is not met{name and f' with {name}'}: {found}")
    return messages


def _parse_condition(text: str) -> Condition:
    """Return a condition from its text."""
    match = _CONDITION_PATTERN.fullmatch(text)
    if match is None:
        advice = "write for example success>=0.99 and p95(robot_time_s)<20"
        raise InputError(f'"{text.strip()}" is no comparison of a metric with a number; {advice}')
    metric, column = match[1], match[2] or ""
    if metric not in (STATISTICS if column else METRICS):
        statistics = ", ".join(f"{name}(COLUMN)" for name in STATISTICS)
        raise InputError(f'there is no metric "{metric}"; the metrics are {", ".join(METRICS)}, {statistics}')
    if column and column not in _COLUMNS:
        raise InputError(f'"{column}" is no numeric column of the runs; these are {", ".join(_COLUMNS)}')
    return Condition(metric, column, match[3], float(match[4]))


def write_junit(
    path: Path, mission_name: str, runs: Sequence[RunRow], make_repeat_command: RepeatCommandFactory
) -> None:
    """Write the report of a sweep of a mission.

    Raises:
        InputError: The file cannot be written.
    """
    with convert_os_errors(f'write the report "{path}"', "name another file with --junit FILE"):
        write_atomically(path, format_junit(mission_name, runs, make_repeat_command))


def format_junit(mission_name: str, runs: Sequence[RunRow], make_repeat_command: RepeatCommandFactory) -> str:
    """Return the report: one test case per run, with the reason of a failure and a command to repeat the run.

    A run with the status FAULT is an error. A run with the status FAILURE or INCOMPLETE is a failure, and so
    is a successful run whose audit contradicts the ledger.
    """
    cases = [_make_case(mission_name, run, make_repeat_command(run)) for run in runs]
    suite = ElementTree.Element(
        "testsuite",
        name=f"executive sweep {mission_name}",
        tests=str(len(cases)),
        failures=str(sum(case.find("failure") is not None for case in cases)),
        errors=str(sum(case.find("error") is not None for case in cases)),
        time=f"{sum(run.wall_time_s for run in runs):.3f}",
    )
    suite.extend(cases)
    root = ElementTree.Element("testsuites")
    root.append(suite)
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{replace_invalid_xml_characters(text)}\n'


def _make_case(mission_name: str, run: RunRow, repeat_command: str) -> ElementTree.Element:
    """Return the test case of a run."""
    name = " ".join((f"seed {run.seed}", *(f"{key}={value}" for key, value in run.variant.items())))
    case = ElementTree.Element("testcase", classname=mission_name, name=name, time=f"{run.wall_time_s:.3f}")
    if run.problem:
        tag, message = "error" if run.status == "FAULT" else "failure", run.explanation or run.status
        element = ElementTree.SubElement(case, tag, type=run.problem, message=message)
        element.text = f"{run.status} {run.problem} {run.node}".strip() + f"\n{message}\n{run.run_directory}"
    ElementTree.SubElement(case, "system-out").text = repeat_command
    return case
