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

J = TypeVar("J")
R = TypeVar("R")

MAX_HALT_DELAY = 0.1
"""Maximum time between a signal to this process and the signals to its workers [s]."""


def run_jobs(
    jobs: Sequence[J],
    run_job: Callable[[J], R],
    make_failure: Callable[[J, BaseException], R],
    *,
    workers: int,
    progress: Callable[[int, int], None] | None = None,
    on_halt: Callable[[], None] | None = None,
) -> list[R | None]:
    """Execute all jobs in worker processes and return the results in the order of the jobs.

    After Ctrl-C or SIGTERM no further job starts, and running jobs are halted; the result of a job that has
    not ended is None. A second signal kills the processes immediately.

    Args:
        jobs: The jobs.
        run_job: Function that executes a job and returns its result.
        make_failure: Function that returns the result of a job that raised an exception or ended its process.
        workers: Number of processes.
        progress: Function that is called with the number of finished jobs and the number of all jobs.
        on_halt: Function that is called after the first signal.

    Raises:
        KeyboardInterrupt: A second signal arrived before the running jobs had halted.
    """
    pending = deque(enumerate(jobs))
    results: dict[int, R] = {}
    running: dict[Future[R], int] = {}
    pool, is_broken, is_halted, halt = WorkerPool(workers), False, False, threading.Event()
    try:
        with handle_signals(HALT_SIGNALS, lambda *_: halt.set()):
            while running or (pending and not is_halted):
                # Only jobs that can start are submitted: a job in the queue of the pool could not be removed.
                while pending and len(running) < workers and not (is_broken or is_halted or halt.is_set()):
                    number, job = pending[0]
                    try:
                        running[pool.submit(run_job, job)] = number
                    except BrokenExecutor:  # A worker died after its last result was read.
                        is_broken = True
                    else:
                        pending.popleft()
                done, _ = wait(running, MAX_HALT_DELAY, FIRST_COMPLETED)
                # Signals within one period count as one: `timeout` signals the process and its group.
                if halt.is_set():
                    halt.clear()
                    if is_halted:
                        kill_workers()
                        raise KeyboardInterrupt
                    is_halted = True
                    if on_halt is not None:
                        on_halt()
                if is_halted:
                    _halt_runs()
                for future in done:
                    number, error = running.pop(future), future.exception()
                    is_broken = is_broken or isinstance(error, BrokenExecutor)
                    if is_halted and isinstance(error, BrokenExecutor):
                        continue  # The signal also reached the workers and killed one.
                    results[number] = future.result() if error is None else make_failure(jobs[number], error)
                    if progress is not None:
                        progress(len(results), len(jobs))
                if is_broken and not running:
                    pool.shutdown()
                    pool, is_broken = WorkerPool(workers), False
    finally:
        pool.shutdown()
    return [results.get(number) for number in range(len(jobs))]


def _halt_runs() -> None:
    """Send SIGINT to all workers; called repeatedly, because a starting run may ignore the first signal."""
    for process in multiprocessing.active_children():
        assert process.pid is not None
        with contextlib.suppress(ProcessLookupError):
            os.kill(process.pid, signal.SIGINT)
