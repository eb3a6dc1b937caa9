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
from executive.run.signals import SIGNALS, handle_signals

J = TypeVar("J")
R = TypeVar("R")

PROMPT = 0.1
"""Longest time between a signal and the halt of the runs [s]."""


def do_all(
    jobs: Sequence[J],
    work: Callable[[J], R],
    broken: Callable[[J, BaseException], R],
    *,
    workers: int,
    progress: Callable[[int, int], None] | None = None,
    halting: Callable[[], None] | None = None,
) -> list[R | None]:
    """Do all jobs in worker processes and return the results in the order of the jobs.

    After Ctrl-C or SIGTERM no further job starts, running jobs halt, and the result of an unfinished job is
    None. A second signal kills the processes immediately.

    Args:
        jobs: The jobs.
        work: Does one job and returns its result.
        broken: Returns the result of a job that raised an exception or ended its process.
        workers: Number of processes.
        progress: Called with the number of finished jobs and of all jobs.
        halting: Called after the first signal.

    Raises:
        KeyboardInterrupt: A second signal arrived before the running jobs had halted.
    """
    to_do = deque(enumerate(jobs))
    results: dict[int, R] = {}
    running: dict[Future[R], int] = {}
    pool, torn, halted, wished = Workers(workers), False, False, threading.Event()
    try:
        with handle_signals(SIGNALS, lambda *_: wished.set()):
            while running or (to_do and not halted):
                # No job waits in the pool, from which it could not be removed.
                while to_do and len(running) < workers and not (torn or halted or wished.is_set()):
                    number, job = to_do[0]
                    try:
                        running[pool.submit(work, job)] = number
                    except BrokenExecutor:  # The process died after its last result was read.
                        torn = True
                    else:
                        to_do.popleft()
                done, _ = wait(running, PROMPT, FIRST_COMPLETED)
                # Two signals within one period count as one: `timeout` signals the process and its group.
                if wished.is_set():
                    wished.clear()
                    if halted:
                        kill_workers()
                        raise KeyboardInterrupt
                    halted = True
                    if halting is not None:
                        halting()
                if halted:
                    _halt_runs()
                for future in done:
                    number, error = running.pop(future), future.exception()
                    torn = torn or isinstance(error, BrokenExecutor)
                    if halted and isinstance(error, BrokenExecutor):
                        continue  # The signal that halted this process also reached its workers.
                    results[number] = future.result() if error is None else broken(jobs[number], error)
                    if progress is not None:
                        progress(len(results), len(jobs))
                if torn and not running:
                    pool.shutdown()
                    pool, torn = Workers(workers), False
    finally:
        pool.shutdown()
    return [results.get(number) for number in range(len(jobs))]


def _halt_runs() -> None:
    """Send SIGINT to all workers; a run that is not ready for it gets the next one."""
    for process in multiprocessing.active_children():
        assert process.pid is not None
        with contextlib.suppress(ProcessLookupError):
            os.kill(process.pid, signal.SIGINT)
