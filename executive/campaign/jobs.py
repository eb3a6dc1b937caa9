"""Jobs of a campaign: one run of a mission with a seed and a variant, and worker processes for many jobs."""

from __future__ import annotations

import contextlib
import errno
import functools
import multiprocessing
import os
import re
import signal
import threading
import traceback
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from executive.behaviours import load_skills
from executive.campaign.results import ENVIRONMENT_REASON, RunRecord, RunRow, SweepSettings, make_record
from executive.errors import InputError, describe_error
from executive.mission.load import LoadedMission, load_mission
from executive.processes import WorkerPool
from executive.record.recorded_run import RecordOptions, record_run
from executive.record.timeline import Timeline
from executive.run.assembly import RunOptions
from executive.run.operator import HALT_SIGNALS, handle_signals
from executive.station.check import load_checker
from executive.station.station import Station
from executive.view.report import try_write_report

Job = TypeVar("Job")
JobResult = TypeVar("JobResult")

MAX_HALT_DELAY = 0.1
"""Maximum time between a signal to this process and the signals to its workers [s]."""
MAX_CRASHES = 2
"""A job fails as soon as this many worker processes have died while they executed it."""
_SYSTEM_ERRORS = [os.strerror(number) for number in (errno.ENOSPC, errno.EDQUOT, errno.ENOMEM, errno.EMFILE)]
_OTHER_ERRORS = "MemoryError|bad_alloc|RecordLost|BrokenProcessPool|KilledWorker|BadZipFile|zlib"
_ENVIRONMENT_FAULT = re.compile("|".join((*_SYSTEM_ERRORS, _OTHER_ERRORS)), re.IGNORECASE)
"""Text of a fault whose cause is the disk, the memory or a killed process, not the run."""


@dataclass(frozen=True)
class MissionUnderTest:
    """A mission with the cell and the seed of its test runs.

    Attributes:
        loaded: The mission, checked together with its cell file.
        make_cell: Function that makes the station.
        cell_description: Kind of the cell, and source of the detections, for reports.
        seed: Random seed; in a series of runs, the seed of the first run.
    """

    loaded: LoadedMission
    make_cell: Callable[..., Station]
    cell_description: str
    seed: int

    @property
    def name(self) -> str:
        """Name of the mission."""
        return self.loaded.mission.name

    @property
    def requests(self) -> list[str]:
        """Requests of the operator: for each class of the mission, as many as objects can be on the table."""
        return [*self.loaded.routes] * self.loaded.cell_config.table.objects[1]


def load_mission_under_test(
    mission: str, overrides: Mapping[str, str], has_oracle: bool, seed: int, cell: str = ""
) -> MissionUnderTest:
    """Load a mission; if `has_oracle` is True, the detectors of its simulated cell return true detections.

    `cell` replaces the mission's cell, as in `load_mission`.

    Raises:
        InputError: The mission does not exist or has errors, or `has_oracle` requires a simulated cell.
    """
    loaded = load_mission(mission, load_skills(), overrides, load_checker, cell)
    kind = loaded.cell_config.kind
    if not has_oracle:
        return MissionUnderTest(loaded, Station, kind, seed)
    if kind != "sim":
        name = loaded.mission.name
        raise InputError(f"--oracle requires a simulated cell, but the cell of {name} is of kind {kind}")
    # The import loads the simulator, which takes 0.5 s; no other cell needs it.
    from executive.testing.oracle import make_oracle_kind

    return MissionUnderTest(loaded, make_oracle_kind(), "sim, true detections", seed)


@dataclass(frozen=True)
class JobOptions:
    """Options of the execution of many jobs.

    Attributes:
        workers: Number of worker processes on this computer.
        on_progress: Function that is called with the number of finished jobs and the number of all jobs.
        on_halt: Function that is called after the first signal (Ctrl-C, SIGTERM).
    """

    workers: int = 2
    on_progress: Callable[[int, int], None] = lambda *_: None
    on_halt: Callable[[], None] = lambda: None


def run_jobs(
    jobs: Sequence[Job],
    run_job: Callable[[Job], JobResult],
    make_fault_result: Callable[[Job, BaseException], JobResult],
    options: JobOptions = JobOptions(),
    on_result: Callable[[int, JobResult, int], None] = lambda *_: None,
) -> list[JobResult | None]:
    """Execute all jobs in worker processes and return the results in the order of the jobs.

    A worker process that dies is replaced, and its job is repeated until `MAX_CRASHES` processes have died.
    After Ctrl-C or SIGTERM no further job starts, and running jobs are halted; the result of an unfinished
    job is None. A second signal kills the processes immediately.

    Args:
        jobs: The jobs.
        run_job: Function that executes a job and returns its result.
        make_fault_result: Function that returns the result after an exception or the death of the processes.
        options: Number of processes, and functions that are called during the execution.
        on_result: Function that is called with the index and the result of each job as soon as it ends, and
            with the number of processes that died during the job.

    Raises:
        KeyboardInterrupt: A second signal arrived before the running jobs had halted.
    """
    pending_indices = deque(range(len(jobs)))
    running_jobs: dict[Future[JobResult], tuple[int, WorkerPool]] = {}
    results: dict[int, JobResult] = {}
    crash_counts: Counter[int] = Counter()
    # Each pool has one process, because the death of a process breaks all jobs of its pool.
    idle_pools = [WorkerPool(1) for _ in range(min(options.workers, len(jobs)))]
    is_halted = False
    signal_event = threading.Event()
    try:
        with handle_signals(HALT_SIGNALS, lambda *_: signal_event.set()):
            while running_jobs or pending_indices:
                # Start jobs in the idle pools. No job starts after a signal.
                while pending_indices and idle_pools and not signal_event.is_set():
                    pool = idle_pools.pop()
                    try:
                        future = pool.submit(run_job, jobs[pending_indices[0]])
                    except BrokenExecutor:  # The process of the pool has died; the job stays pending.
                        pool.shutdown()
                        idle_pools.append(WorkerPool(1))
                    else:
                        running_jobs[future] = pending_indices.popleft(), pool
                ended_jobs, _ = wait(running_jobs, MAX_HALT_DELAY, FIRST_COMPLETED)
                # Halt after the first signal, and quit after the second one. Two signals within
                # `MAX_HALT_DELAY` count as one signal: the command `timeout` sends two.
                if signal_event.is_set():
                    signal_event.clear()
                    if is_halted:
                        for _, pool in running_jobs.values():
                            pool.kill()
                        raise KeyboardInterrupt
                    is_halted = True
                    pending_indices.clear()
                    options.on_halt()
                if is_halted:
                    _halt_runs()
                # Store the results. A job whose process died becomes pending again, or has failed.
                for future in ended_jobs:
                    index, pool = running_jobs.pop(future)
                    error = future.exception()
                    idle_pools.append(pool)
                    if isinstance(error, BrokenExecutor):
                        if is_halted:
                            continue  # The signal also killed the worker.
                        crash_counts[index] += 1
                        if crash_counts[index] < MAX_CRASHES:
                            pending_indices.appendleft(index)
                            continue
                    results[index] = make_fault_result(jobs[index], error) if error else future.result()
                    on_result(index, results[index], crash_counts[index])
                    options.on_progress(len(results), len(jobs))
    finally:
        for pool in (*idle_pools, *(pool for _, pool in running_jobs.values())):
            pool.shutdown()
    return list(map(results.get, range(len(jobs))))


def _halt_runs() -> None:
    """Send SIGINT to all workers; repeated calls are necessary, because a starting run ignores SIGINT."""
    for process in multiprocessing.active_children():
        assert process.pid is not None
        with contextlib.suppress(ProcessLookupError):
            os.kill(process.pid, signal.SIGINT)


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
    return [
        SweepJob(settings, index, variant, seed, runs_folder)
        for index, (variant, seed) in enumerate(settings.combinations)
    ]


def run_job(job: SweepJob) -> RunRecord:
    """Execute and record one run, and return its rows; write a report if the run has a problem."""
    settings = job.settings
    timeline = Timeline()
    overrides = {**settings.overrides, **job.variant}
    loaded = _load_mission(settings.mission, tuple(overrides.items()), settings.replacing_cell)
    options = RunOptions(job.seed, driver_options=settings.driver_options)
    record_options = RecordOptions(saves_pictures=settings.saves_images, timeline=timeline)
    result = record_run(loaded, options, job.runs_folder, record_options)
    record = make_record(job.index, job.variant, result, timeline)
    if record.run.status == "FAULT":
        reason = find_fault_reason(f"{result.message}\n{timeline.traceback}")
        record = replace(record, run=replace(record.run, reason=reason))
    if record.run.problem:
        try_write_report(result.run)
    return record


def make_fault_record(job: SweepJob, error: BaseException) -> RunRecord:
    """Return the record of a run that raised an exception or whose processes died."""
    run = RunRow(
        run_index=job.index, seed=job.seed, variant=job.variant, status="FAULT",
        reason=find_fault_reason("".join(traceback.format_exception(error))), message=describe_error(error),
    )  # fmt: skip
    return RunRecord(run)


def find_fault_reason(text: str) -> str:
    """Return the reason of a fault whose messages and traceback are `text`.

    The text is searched, because an exception loses its causes between processes, but not its traceback.
    """
    return ENVIRONMENT_REASON if _ENVIRONMENT_FAULT.search(text) else "fault"


@functools.lru_cache(maxsize=4)
def _load_mission(mission: str, overrides: tuple[tuple[str, str], ...], cell: str) -> LoadedMission:
    """Return the mission; cached, because a worker runs the same mission many times."""
    return load_mission(mission, load_skills(), dict(overrides), replacing_cell=cell)
