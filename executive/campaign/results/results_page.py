"""Page of a sweep or a comparison: one self-contained HTML file without scripts."""

from __future__ import annotations

import os.path
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from urllib.parse import quote

import numpy as np

from executive.campaign.results.rows import describe_variant
from executive.campaign.results.sweep_summary import Difference, RunPair, SweepResults, VariantSummary
from executive.record.atomic_file import write_atomically
from executive.record.run_directory import RunDirectory, convert_os_errors
from executive.view.report.page import try_write_report
from executive.view.text import render_template

PAGE_NAME = "results.html"
"""Name of the page in the folder of a sweep or a comparison."""
BIN_COUNT = 24
"""Number of bars of a histogram."""
MAX_LISTED_RUNS = 500
"""Maximum number of runs in a table of the page."""


@dataclass(frozen=True)
class VariantRuns:
    """Runs of one variant of a sweep; each table of the page has a column for each variant.

    Attributes:
        label: Side of the comparison (`A` or `B`) and values of the variant; `all runs` if both
            are empty.
        summary: Summary of the runs.
        robot_times: Duration of each run [s].
        item_times: Time during which each placed item was the selected target [s].
    """

    label: str
    summary: VariantSummary
    robot_times: Sequence[float]
    item_times: Sequence[float]


@dataclass(frozen=True)
class Histogram:
    """Histogram of the values of a group.

    Attributes:
        description: Label of the group, number of values, range and median: the alternative text of the plot.
        counts: Number of values in each bin.
        low, high: Lower edge of the first bin and upper edge of the last bin; equal for all groups.
    """

    description: str
    counts: Sequence[int]
    low: float
    high: float


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
    groups = [group for sweep in sweeps for group in _list_groups(sweep)]
    problems = [(sweep, run) for sweep in sweeps for run in sweep.runs if run.problem]
    path = folder / PAGE_NAME
    page = render_template(
        "results/results.html",
        sweeps=sweeps,
        groups=groups,
        plots={
            "Robot time of a run [s]": _make_histograms({group.label: group.robot_times for group in groups}),
            "Time per placed item [s]": _make_histograms({group.label: group.item_times for group in groups}),
        },
        skills=list(dict.fromkeys(skill.skill for group in groups for skill in group.summary.skills)),
        differences=differences,
        changed_pairs=changed_pairs,
        problems=problems,
        limit=MAX_LISTED_RUNS,
        link=lambda run_directory: _make_link(run_directory, folder),
        describe_variant=describe_variant,
    )
    with convert_os_errors(f'write the page "{path}"', "free some space, or make the folder writable"):
        write_atomically(path, page)
    return path


def _list_groups(sweep: SweepResults) -> list[VariantRuns]:
    """Return one group for each variant of a sweep."""
    groups = []
    for summary in sweep.summaries:
        runs = {run.run_index: run for run in sweep.runs if run.variant == summary.variant}
        items = [item for item in sweep.items if item.run_index in runs and item.state == "placed"]
        label = " ".join(filter(None, (sweep.side, describe_variant(summary.variant)))) or "all runs"
        times = [run.robot_time_s for run in runs.values()]
        groups.append(VariantRuns(label, summary, times, [item.robot_time_s for item in items]))
    return groups


def _make_histograms(values_by_label: Mapping[str, Sequence[float]]) -> list[Histogram]:
    """Return one histogram for each group with values, all with the same bins."""
    all_values = [value for values in values_by_label.values() for value in values]
    edges = np.histogram_bin_edges(all_values, BIN_COUNT) if all_values else np.zeros(2)
    histograms = []
    for label, values in values_by_label.items():
        if values:
            value_range = f"{min(values):.2f} to {max(values):.2f}, median {median(values):.2f}"
            description = f"{label}: {len(values)} values from {value_range}"
            counts = np.histogram(values, edges)[0].tolist()
            histograms.append(Histogram(description, counts, float(edges[0]), float(edges[-1])))
    return histograms


def _make_link(run_directory: str, folder: Path) -> str:
    """Return the URL of the report in `run_directory`, relative to `folder`; "" without a report."""
    report = RunDirectory(Path(run_directory)).report
    return quote(os.path.relpath(report, folder)) if run_directory and report.is_file() else ""


def write_missing_reports(pairs: Sequence[RunPair]) -> None:
    """Write the report of each run that has a run directory without a report."""
    for run in (run for pair in pairs for run in (pair.a, pair.b)):
        if run.run_directory and not RunDirectory(Path(run.run_directory)).report.is_file():
            try_write_report(run.run_directory)
