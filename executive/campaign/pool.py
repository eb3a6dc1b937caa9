"""Execution of many jobs in worker processes; the first signal halts the runs, the second kills them."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections import Counter, deque
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from dataclasses import dataclass
from typing import TypeVar

from executive.processes import WorkerPool, kill_workers
from executive.run.run_control import HALT_SIGNALS, handle_signals

Job = TypeVar("Job")
JobResult = TypeVar("JobResult")

MAX_HALT_DELAY = 0.1
"""Maximum time between a signal to this process and the signals to its workers [s]."""
MAX_CRASHES = 2
"""A job fails as soon as this many worker processes have died while they executed it."""


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
    is_halted, signal_event = False, threading.Event()
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
                        kill_workers()
                        raise KeyboardInterrupt
                    is_halted = True
                    pending_indices.clear()
                    options.on_halt()
                if is_halted:
                    _halt_runs()
                # Store the results. A job whose process died becomes pending again, or has failed.
                for future in ended_jobs:
                    (index, pool), error = running_jobs.pop(future), future.exception()
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
