"""Page of a sweep or a comparison: one self-contained HTML file without scripts."""

from __future__ import annotations

import os.path
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from executive.campaign.results import describe_variant
from executive.campaign.sweep_summary import Difference, RunPair, SweepResults, VariantSummary
from executive.record.run_directory import RunDirectory, convert_os_errors, write_atomically
from executive.view.report import try_write_report
from executive.view.text import render_template

PAGE_NAME = "results.html"
"""Name of the page in the folder of a sweep or a comparison."""
MAX_LISTED_RUNS = 500
"""Maximum number of runs in a table of the page."""


@dataclass(frozen=True)
class VariantColumn:
    """One variant of a sweep; each table of the page has a column for each variant.

    Attributes:
        label: Side of the comparison (`A` or `B`) and values of the variant; `all runs` if both
            are empty.
        summary: Summary of the runs.
    """

    label: str
    summary: VariantSummary


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
        "results.html",
        sweeps=sweeps,
        groups=groups,
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


def _list_groups(sweep: SweepResults) -> list[VariantColumn]:
    """Return one group for each variant of a sweep."""
    groups = []
    for summary in sweep.summaries:
        label = " ".join(filter(None, (sweep.side, describe_variant(summary.variant)))) or "all runs"
        groups.append(VariantColumn(label, summary))
    return groups


def _make_link(run_directory: str, folder: Path) -> str:
    """Return the URL of the report in `run_directory`, relative to `folder`; "" without a report."""
    report = RunDirectory(Path(run_directory)).report
    return quote(os.path.relpath(report, folder)) if run_directory and report.is_file() else ""


def write_missing_reports(pairs: Sequence[RunPair]) -> None:
    """Write the report of each run that has a run directory without a report."""
    for run in (run for pair in pairs for run in (pair.a, pair.b)):
        if run.run_directory and not RunDirectory(Path(run.run_directory)).report.is_file():
            try_write_report(run.run_directory)
