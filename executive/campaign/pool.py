"""Execution of many jobs in worker processes; the first signal halts the runs, the second kills them."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from typing import TypeVar

from executive.processes import WorkerPool, kill_workers
from executive.run.signals import HALT_SIGNALS, handle_signals

Job = TypeVar("Job")
JobResult = TypeVar("JobResult")

MAX_HALT_DELAY = 0.1
"""Maximum time between a signal to this process and the signals to its workers [s]."""


def run_jobs(
    jobs: Sequence[Job],
    run_job: Callable[[Job], JobResult],
    make_failure: Callable[[Job, BaseException], JobResult],
    *,
    workers: int,
    progress: Callable[[int, int], None] = lambda *_: None,
    on_halt: Callable[[], None] = lambda: None,
) -> list[JobResult | None]:
    """Execute all jobs in worker processes and return the results in the order of the jobs.

    After Ctrl-C or SIGTERM no further job starts, and running jobs are halted; the result of an unfinished
    job is None. A second signal kills the processes immediately.

    Args:
        jobs: The jobs.
        run_job: Function that executes a job and returns its result.
        make_failure: Function that returns the result after an exception or the death of a process.
        workers: Number of processes.
        progress: Function that is called with the number of finished jobs and the number of all jobs.
        on_halt: Function that is called after the first signal.

    Raises:
        KeyboardInterrupt: A second signal arrived before the running jobs had halted.
    """
    pending_indices = deque(range(len(jobs)))
    results: dict[int, JobResult] = {}
    running_jobs: dict[Future[JobResult], int] = {}
    pool, is_broken, is_halted, signal_event = WorkerPool(workers), False, False, threading.Event()
    try:
        with handle_signals(HALT_SIGNALS, lambda *_: signal_event.set()):
            while running_jobs or (pending_indices and not is_halted):
                # The pool gets only jobs that can start at once, because queued jobs cannot be removed.
                while pending_indices and len(running_jobs) < workers:
                    if is_broken or is_halted or signal_event.is_set():
                        break
                    index = pending_indices[0]
                    try:
                        running_jobs[pool.submit(run_job, jobs[index])] = index
                        pending_indices.popleft()
                    except BrokenExecutor:  # A worker died after its last result was read.
                        is_broken = True
                ended_jobs, _ = wait(running_jobs, MAX_HALT_DELAY, FIRST_COMPLETED)
                # Two signals within `MAX_HALT_DELAY` count as one signal: the command `timeout` sends two.
                if signal_event.is_set():
                    signal_event.clear()
                    if is_halted:
                        kill_workers()
                        raise KeyboardInterrupt
                    is_halted = True
                    on_halt()
                if is_halted:
                    _halt_runs()
                for future in ended_jobs:
                    index, error = running_jobs.pop(future), future.exception()
                    is_broken = is_broken or isinstance(error, BrokenExecutor)
                    if is_halted and isinstance(error, BrokenExecutor):
                        continue  # The signal also killed a worker.
                    results[index] = future.result() if error is None else make_failure(jobs[index], error)
                    progress(len(results), len(jobs))
                if is_broken and not running_jobs:
                    pool.shutdown()
                    pool, is_broken = WorkerPool(workers), False
    finally:
        pool.shutdown()
    return list(map(results.get, range(len(jobs))))


def _halt_runs() -> None:
    """Send SIGINT to all workers; repeated calls are necessary, because a starting run ignores SIGINT."""
    for process in multiprocessing.active_children():
        assert process.pid is not None
        with contextlib.suppress(ProcessLookupError):
            os.kill(process.pid, signal.SIGINT)
