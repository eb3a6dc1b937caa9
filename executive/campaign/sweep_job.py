"""Job of a sweep: one run of a mission with a seed and a variant, and the rows of its results."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from executive.campaign.results.rows import RunRecord, RunRow, SweepSettings, make_record
from executive.errors import ExecutiveError
from executive.mission.load import LoadedMission, load_mission
from executive.plugins import load_skills
from executive.record.recorded_run import RecordOptions, record_run
from executive.record.timeline import Timeline
from executive.run.assembly import RunOptions
from executive.view.report import try_write_report


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


def run_job(job: SweepJob) -> RunRecord:
    """Execute and record one run, and return its rows; write a report if the run has a problem."""
    settings = job.settings
    timeline = Timeline()
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
