"""Many jobs in processes of their own, until they are done or somebody halts them."""

from __future__ import annotations

import multiprocessing
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from typing import Any, TypeVar

J = TypeVar("J")
R = TypeVar("R")


def do_all(
    jobs: Sequence[J],
    work: Callable[[J], R],
    broken: Callable[[J, BaseException], R],
    *,
    workers: int,
    progress: Callable[[int, int], None] | None = None,
) -> list[R | None]:
    """Do every job in some process and return the results in the order of the jobs.

    After Ctrl-C no further job begins, and None is what those have that were not done.

    Args:
        jobs: What is to be done.
        work: What does one job.
        broken: Returns the result of a job whose work raised, or that took its process down.
        workers: How many processes work at a time.
        progress: Told how many jobs of how many are done.
    """
    to_do = deque(enumerate(jobs))
    results: dict[int, R] = {}
    running: dict[Future[R], int] = {}
    pool, torn = new_pool(workers), False
    try:
        with _halting() as halted:
            while running or (to_do and not halted.is_set()):
                # No job waits in the pool: one that does could not be taken back.
                while to_do and len(running) < workers and not (torn or halted.is_set()):
                    number, job = to_do[0]
                    try:
                        running[pool.submit(work, job)] = number
                    except BrokenExecutor:  # The process died since its last result was looked at.
                        torn = True
                    else:
                        to_do.popleft()
                done, _ = wait(running, return_when=FIRST_COMPLETED)
                for future in done:
                    number, error = running.pop(future), future.exception()
                    results[number] = future.result() if error is None else broken(jobs[number], error)
                    if progress is not None:
                        progress(len(results), len(jobs))
                    torn = torn or isinstance(error, BrokenExecutor)
                if torn and not running:
                    pool.shutdown()
                    pool, torn = new_pool(workers), False
    finally:
        pool.shutdown()
    return [results.get(number) for number in range(len(jobs))]


def new_pool(workers: int) -> ProcessPoolExecutor:
    """Return a pool of fresh processes that leave Ctrl-C to their parent and to runs under way."""
    # A fork would share the simulator's and the inference library's threads and locks.
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(workers, mp_context=context, initializer=_ignore_interrupts)


def _ignore_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def _halting() -> Iterator[threading.Event]:
    """Set the event at the first Ctrl-C; at the second, end the jobs under way, too."""
    halted = threading.Event()

    def halt(number: int, frame: Any) -> None:
        del number, frame
        if halted.is_set():
            for process in multiprocessing.active_children():
                process.terminate()
            raise KeyboardInterrupt
        halted.set()

    previous = signal.signal(signal.SIGINT, halt)
    try:
        yield halted
    finally:
        signal.signal(signal.SIGINT, previous)
