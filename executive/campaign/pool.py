"""Many jobs in processes of their own, until they are done or somebody halts them."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from types import FrameType
from typing import TypeVar

from executive.processes import Workers, kill_workers
from executive.run.signals import SIGNALS, handle_signals

J = TypeVar("J")
R = TypeVar("R")

PROMPT = 0.1
"""Longest time after which a wish to halt is heeded [s]."""


def do_all(
    jobs: Sequence[J],
    work: Callable[[J], R],
    broken: Callable[[J, BaseException], R],
    *,
    workers: int,
    progress: Callable[[int, int], None] | None = None,
    halting: Callable[[], None] | None = None,
) -> list[R | None]:
    """Do every job in some process and return the results in the order of the jobs.

    After Ctrl-C or SIGTERM no further job begins, runs under way halt, and None is what those jobs have that
    were not done. A second one ends the processes at once.

    Args:
        jobs: What is to be done.
        work: What does one job.
        broken: Returns the result of a job whose work raised, or that took its process down.
        workers: How many processes work at a time.
        progress: Told how many jobs of how many are done.
        halting: Told that somebody wished to halt, as soon as they do.

    Raises:
        KeyboardInterrupt: Somebody did not want to wait until the jobs under way have halted.
    """
    to_do = deque(enumerate(jobs))
    results: dict[int, R] = {}
    running: dict[Future[R], int] = {}
    pool, torn, halted = Workers(workers), False, False
    try:
        with _wishes() as wished:
            while running or (to_do and not halted):
                # No job waits in the pool: one that does could not be taken back.
                while to_do and len(running) < workers and not (torn or halted or wished.is_set()):
                    number, job = to_do[0]
                    try:
                        running[pool.submit(work, job)] = number
                    except BrokenExecutor:  # The process died since its last result was looked at.
                        torn = True
                    else:
                        to_do.popleft()
                done, _ = wait(running, PROMPT, FIRST_COMPLETED)
                # What comes at once, as from `timeout`, which tells the process and then its group, is one.
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
                        continue  # Whoever halted this process halted its workers, too.
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
    """Ask every worker's run to halt; one that is still being made does not hear it and is asked again."""
    for process in multiprocessing.active_children():
        assert process.pid is not None
        with contextlib.suppress(ProcessLookupError):
            os.kill(process.pid, signal.SIGINT)


@contextlib.contextmanager
def _wishes() -> Iterator[threading.Event]:
    """Set the event whenever somebody wishes to halt, instead of what the signal did before."""
    wished = threading.Event()

    def wish(number: int, frame: FrameType | None) -> None:
        del number, frame
        wished.set()

    with handle_signals(SIGNALS, wish):
        yield wished
