"""Comparison: two sweeps with the same seeds, in one folder."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from executive.campaign.results.database import FILE_NAME, ResultsDatabase
from executive.campaign.results.differences import RunPair
from executive.campaign.results.rows import SweepSettings
from executive.campaign.results.sweep_folder import open_sweep
from executive.record.run_directory import RunDirectory, make_dated_folder
from executive.view.report.page import try_write_report

SIDES = ("a", "b")
"""Names of the folders of the two sweeps."""


def create_comparison(settings: Sequence[SweepSettings], runs: Path) -> list[ResultsDatabase]:
    """Create the folder `RUNS/<YYYY-MM-DD>/<HH-MM-SS>_compare_<mission>` with the databases of two sweeps.

    Raises:
        InputError: The folder cannot be made.
    """
    name = "_".join(dict.fromkeys(each.mission_name for each in settings))
    folder = make_dated_folder(runs, f"compare_{name}", datetime.now())
    databases = []
    for side, each in zip(SIDES, settings, strict=True):
        (folder / side).mkdir()
        databases.append(ResultsDatabase(folder / side / FILE_NAME, each))
        databases[-1].lock()
    return databases


def open_comparison(folder: Path) -> list[ResultsDatabase]:
    """Open the databases of a comparison to resume the comparison.

    Raises:
        InputError: There is no such comparison, or an input has changed.
    """
    return [open_sweep(folder / side) for side in SIDES]


def write_missing_reports(pairs: Sequence[RunPair]) -> None:
    """Write the report of each run with a run directory in which the report is missing."""
    for run in (run for pair in pairs for run in (pair.a, pair.b)):
        if run.run and not RunDirectory(Path(run.run)).report.is_file():
            try_write_report(run.run)
