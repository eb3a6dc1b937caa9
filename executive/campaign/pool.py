"""Execution of many jobs in worker processes, with a controlled halt."""

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

from executive.processes import Workers, kill_workers
from executive.run.signals import HALT_SIGNALS, handle_signals

J = TypeVar("J")
R = TypeVar("R")

HALT_DELAY = 0.1
"""Maximum time between a signal and the halt of the runs [s]."""


def run_jobs(
    jobs: Sequence[J],
    work: Callable[[J], R],
    make_failure: Callable[[J, BaseException], R],
    *,
    workers: int,
    progress: Callable[[int, int], None] | None = None,
    halting: Callable[[], None] | None = None,
) -> list[R | None]:
    """Execute all jobs in worker processes and return the results in the order of the jobs.

    After Ctrl-C or SIGTERM no further job starts, running jobs halt, and the result of an unfinished job is
    None. A second signal kills the processes immediately.

    Args:
        jobs: The jobs.
        work: Executes one job and returns its result.
        make_failure: Returns the result of a job that raised an exception or ended its process.
        workers: Number of processes.
        progress: Called with the number of finished jobs and of all jobs.
        halting: Called after the first signal.

    Raises:
        KeyboardInterrupt: A second signal arrived before the running jobs had halted.
    """
    waiting = deque(enumerate(jobs))
    results: dict[int, R] = {}
    running: dict[Future[R], int] = {}
    pool, is_dead, is_halted, signalled = Workers(workers), False, False, threading.Event()
    try:
        with handle_signals(HALT_SIGNALS, lambda *_: signalled.set()):
            while running or (waiting and not is_halted):
                # No job waits in the pool, from which it could not be removed.
                while waiting and len(running) < workers and not (is_dead or is_halted or signalled.is_set()):
                    number, job = waiting[0]
                    try:
                        running[pool.submit(work, job)] = number
                    except BrokenExecutor:  # The process died after its last result was read.
                        is_dead = True
                    else:
                        waiting.popleft()
                done, _ = wait(running, HALT_DELAY, FIRST_COMPLETED)
                # Two signals within one period count as one: `timeout` signals the process and its group.
                if signalled.is_set():
                    signalled.clear()
                    if is_halted:
                        kill_workers()
                        raise KeyboardInterrupt
                    is_halted = True
                    if halting is not None:
                        halting()
                if is_halted:
                    _halt_runs()
                for future in done:
                    number, error = running.pop(future), future.exception()
                    is_dead = is_dead or isinstance(error, BrokenExecutor)
                    if is_halted and isinstance(error, BrokenExecutor):
                        continue  # The signal that halted this process also reached its workers.
                    results[number] = future.result() if error is None else make_failure(jobs[number], error)
                    if progress is not None:
                        progress(len(results), len(jobs))
                if is_dead and not running:
                    pool.shutdown()
                    pool, is_dead = Workers(workers), False
    finally:
        pool.shutdown()
    return [results.get(number) for number in range(len(jobs))]


def _halt_runs() -> None:
    """Send SIGINT to all workers, repeatedly, because a run may not be ready for the first one."""
    for process in multiprocessing.active_children():
        assert process.pid is not None
        with contextlib.suppress(ProcessLookupError):
            os.kill(process.pid, signal.SIGINT)
