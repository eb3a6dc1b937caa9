"""Child processes: worker pools that end with their parent process, and commands that run a module."""

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

Result = TypeVar("Result")


class WorkerPool(ProcessPoolExecutor):
    """A pool of spawned processes that ends with its parent process.

    The processes ignore Ctrl-C, which a terminal sends to all of them, so that the parent process decides
    when they stop. An exception in the `with` block kills the processes.

    Args:
        count: Maximum number of processes.
    """

    def __init__(self, count: int) -> None:
        # A forked process would contain locks of threads that it does not have.
        spawn = multiprocessing.get_context("spawn")
        super().__init__(count, mp_context=spawn, initializer=_initialize_worker)

    def submit(self, fn: Callable[..., Result], /, *args: Any, **kwargs: Any) -> Future[Result]:
        """Call `fn` in one of the processes; the call may start a process."""
        # A new process inherits the signal mask, which blocks Ctrl-C until the process ignores it.
        previous_mask = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            return super().submit(fn, *args, **kwargs)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, previous_mask)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool | None:
        """Wait for all submitted calls; after an exception, kill the processes instead."""
        if kind is not None:
            kill_workers()
        return super().__exit__(kind, error, trace)


def kill_workers() -> None:
    """Kill all processes that `multiprocessing` started; their pools are unusable afterwards."""
    for process in multiprocessing.active_children():
        # After SIGTERM, a run would halt regularly, and the process would lose the order of its queue.
        process.kill()


def _initialize_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    threading.Thread(target=_exit_with_parent, name="exit with parent", daemon=True).start()


def _exit_with_parent() -> None:
    """Wait until the parent process has ended, then exit at once."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    # `join` waits for the parent process, not for the thread that started this process.
    parent.join()
    os._exit(1)


def build_command(module: str, *arguments: str) -> list[str]:
    """Return the command that runs a module with the interpreter of this process.

    Unlike `python -m`, the command does not import modules from the working directory, in which a file of the
    user may have the name of a library.
    """
    script = (
        "import sys; sys.path[:] = filter(None, sys.path); "
        "module = sys.argv.pop(1); import runpy; runpy.run_module(module, None, '__main__')"
    )
    return [sys.executable, "-c", script, module, *arguments]
