"""Sweep: runs of one mission with many seeds and variants, in worker processes, stored in a database."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import replace

from executive.campaign.cluster.cluster import run_jobs_on_cluster
from executive.campaign.pool import JobOptions, run_jobs
from executive.campaign.results.database import ResultsDatabase
from executive.campaign.results.rows import RunRecord, RunRow, SweepSettings
from executive.campaign.results.sweep_summary import SweepResults, summarize_runs
from executive.campaign.sweep_job import SweepJob, list_jobs, make_fault_record, run_job
from executive.view.terminal import format_repeat_command


def make_repeat_command(settings: SweepSettings, run: RunRow) -> str:
    """Return the command line that repeats a run of a sweep."""
    overrides = {**settings.overrides, **run.variant}
    return format_repeat_command(settings.mission, run.seed, overrides, scene=settings.scene)


def run_sweep(
    jobs: Sequence[SweepJob], database: ResultsDatabase, options: JobOptions, cluster: str | None = None
) -> None:
    """Execute all jobs, and store the record of each run as soon as the run ends.

    A run gets the status `FAULT` after two of its worker processes died. After Ctrl-C or SIGTERM no further
    run starts, and current runs are halted; halted runs are not stored. `cluster` is the address of a dask
    scheduler, whose workers execute the jobs, or None.
    """

    def store(_: int, record: RunRecord, crash_count: int) -> None:
        if record.run.status != "HALTED":
            database.append(replace(record, run=replace(record.run, crashes=crash_count)))

    if cluster is None:
        run_jobs(jobs, run_job, make_fault_record, options, store)
    else:
        run_jobs_on_cluster(jobs, cluster, options, store)


def read_results(database: ResultsDatabase, side: str = "") -> SweepResults:
    """Return the results of all stored runs of a sweep; `side` is `A` or `B` in a comparison, else ""."""
    settings = database.settings
    runs = database.read_runs()
    make_command = functools.partial(make_repeat_command, settings)
    summaries = summarize_runs(runs, database.read_skills(), make_command)
    planned_run_count = len(list_jobs(settings, database.path.parent))
    return SweepResults(side, settings, runs, summaries, planned_run_count)
