"""Child processes: worker pools that end with their parent, and commands that run a module."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from types import TracebackType
from typing import Any, TypeVar

R = TypeVar("R")


class Workers(ProcessPoolExecutor):
    """A pool of fresh processes; left by an exception, it ends what they are at.

    They ignore Ctrl-C, which a terminal sends to them as well as to their parent: what is to become of their
    work the parent decides. If it is killed, they end, too.

    Args:
        count: How many there are at most.
    """

    def __init__(self, count: int) -> None:
        # A fork would share the simulator's and the inference library's threads and locks.
        super().__init__(count, mp_context=multiprocessing.get_context("spawn"), initializer=_begin)

    def submit(self, fn: Callable[..., R], /, *args: Any, **kwargs: Any) -> Future[R]:
        """Have `fn` called in one of the processes, which may be started for it."""
        # It inherits what is blocked: no Ctrl-C can reach it before it is ready to ignore one.
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            return super().submit(fn, *args, **kwargs)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool | None:
        """Wait for the work that was submitted; after an exception, end it instead."""
        if kind is not None:
            kill_workers()
        return super().__exit__(kind, error, trace)


def kill_workers() -> None:
    """End every child that `multiprocessing` started, whatever it is at; its pool is then broken."""
    for process in multiprocessing.active_children():
        # SIGTERM would let a run under way halt in good order, and the order of its queue would be lost.
        process.kill()


def _begin() -> None:
    """Make this process a worker."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    threading.Thread(target=_end_with_parent, name="end with parent", daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    # A pipe to the parent tells, on every system and from whichever of its threads the worker came.
    parent.join()
    os._exit(1)


def program(module: str, *words: str) -> list[str]:
    """Return the command that runs a module with the interpreter of this process.

    `python -m` would look into the working directory first: a file of a library's name beside somebody's
    mission would be run in its place.
    """
    start = (
        "import sys; sys.path[:] = filter(None, sys.path); "
        "module = sys.argv.pop(1); import runpy; runpy.run_module(module, None, '__main__')"
    )
    return [sys.executable, "-c", start, module, *words]
