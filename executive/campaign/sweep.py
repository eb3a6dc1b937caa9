"""Sweep: runs of one mission with many seeds and variants, in worker processes, stored in a database."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

from executive.campaign.pool import JobOptions, run_jobs
from executive.campaign.results.database import ResultsDatabase
from executive.campaign.results.rows import RunRecord, RunRow, SweepSettings, make_record
from executive.campaign.results.sweep_summary import SweepResults, summarize_runs
from executive.campaign.results.tables import ITEMS, RUNS, SKILLS
from executive.errors import ExecutiveError
from executive.mission.load import LoadedMission, load_mission
from executive.plugins import load_skills
from executive.record.recorded_run import RecordOptions, record_run
from executive.record.timeline.timeline import Timeline
from executive.run.assembly import RunOptions
from executive.view.report.page import try_write_report
from executive.view.terminal.summary import format_repeat_command


@dataclass(frozen=True)
class SweepJob:
    """One run of a sweep.

    Attributes:
        settings: Settings of the sweep.
        index: Index of the run in the sweep.
        variant: Values of the varied params and keys of the cell, by name.
        seed: Random seed.
        runs_folder: Folder in which the run directory is made.
    """

    settings: SweepSettings
    index: int
    variant: Mapping[str, str]
    seed: int
    runs_folder: Path


def list_jobs(settings: SweepSettings, runs_folder: Path) -> list[SweepJob]:
    """Return all jobs of a sweep, variant by variant and seed by seed."""
    combinations = product(settings.variants, range(settings.first_seed, settings.last_seed + 1))
    return [
        SweepJob(settings, index, variant, seed, runs_folder)
        for index, (variant, seed) in enumerate(combinations)
    ]


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
        from executive.campaign.cluster.cluster import run_jobs_on_cluster

        run_jobs_on_cluster(jobs, cluster, options, store)


def read_results(database: ResultsDatabase, side: str = "") -> SweepResults:
    """Return the results of all stored runs of a sweep; `side` is `A` or `B` in a comparison, else ""."""
    settings, runs, skills = database.settings, database.read(RUNS), database.read(SKILLS)
    summaries = summarize_runs(runs, skills, functools.partial(make_repeat_command, settings))
    planned_run_count = len(list_jobs(settings, database.path.parent))
    return SweepResults(side, settings, runs, database.read(ITEMS), summaries, planned_run_count)


def run_job(job: SweepJob) -> RunRecord:
    """Execute and record one run, and return its rows; write a report if the run has a problem."""
    settings, timeline = job.settings, Timeline()
    loaded = _load_mission(settings.mission, tuple({**settings.overrides, **job.variant}.items()))
    options = RunOptions(job.seed, scene=settings.scene)
    record_options = RecordOptions(saves_pictures=settings.saves_images, timeline=timeline)
    result = record_run(loaded, options, job.runs_folder, record_options)
    record = make_record(job.index, job.variant, result, timeline)
    if record.run.problem:
        try_write_report(result.run)
    return record


def make_fault_record(job: SweepJob, error: BaseException) -> RunRecord:
    """Return the record of a run that raised an exception or whose processes died."""
    text = str(error) if isinstance(error, ExecutiveError) else f"{type(error).__name__}: {error}"
    run = RunRow(
        run_index=job.index, seed=job.seed, variant=job.variant, status="FAULT", reason="fault", message=text
    )
    return RunRecord(run)


@functools.lru_cache(maxsize=4)
def _load_mission(mission: str, overrides: tuple[tuple[str, str], ...]) -> LoadedMission:
    """Return the mission; cached, because a worker runs the same mission many times."""
    return load_mission(mission, load_skills(), dict(overrides))
