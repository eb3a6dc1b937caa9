"""Processes and threads: worker pools, commands that run a module, waits, and ends of threads and processes.

A thread that code of another project leaves behind never keeps a process alive.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor, wait
from contextlib import contextmanager
from multiprocessing import util as multiprocessing_util
from types import TracebackType
from typing import Any, TypeVar

from executive.errors import shorten_quotations

ReturnT = TypeVar("ReturnT")
"""Type of the return value of a submitted function."""

THREAD_COUNT_VARIABLES = ("OMP_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
"""Environment variables with the number of threads: of linear algebra and models, and of OpenCV."""
MAX_BLOCKING_TIME = 0.05
"""Maximum uninterrupted wait for another thread [s]; within this time, Python handles a signal, for example
a second Ctrl-C, which ends the process at once."""
MAX_END_TIME = 5.0
"""Maximum time for the end of threads, after which a process ends without the end of its threads [s]."""
CONTROL_THRESHOLD = 700
"""Number of new objects after which Python collects garbage between control steps: the default of Python."""


class WorkerPool(ProcessPoolExecutor):
    """A pool of spawned processes that ends with its parent process.

    Libraries in a process of the pool use one thread, because the processes of a pool use all processors.
    A terminal sends Ctrl-C to all processes. The processes of the pool ignore Ctrl-C, so that the parent
    process decides when they end. An exception in the `with` block kills the processes.

    Args:
        max_workers: Maximum number of processes.
    """

    def __init__(self, max_workers: int) -> None:
        # A fork copies locks that other threads hold, without the threads that would release them.
        spawn = multiprocessing.get_context("spawn")
        super().__init__(max_workers, mp_context=spawn, initializer=_initialize_worker)

    def submit(self, fn: Callable[..., ReturnT], /, *args: Any, **kwargs: Any) -> Future[ReturnT]:
        """Call `fn` in a process of the pool; start a process if all are busy."""
        # A new process inherits the signal mask: Ctrl-C is blocked until `_initialize_worker` ignores it.
        previous_mask = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            return super().submit(fn, *args, **kwargs)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, previous_mask)

    def kill(self) -> None:
        """Kill the processes of the pool; the pool is unusable afterwards."""
        for process in list((self._processes or {}).values()):
            # A run would handle SIGTERM as a halt, and the process would not end.
            process.kill()

    def __exit__(
        self, cls: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> bool | None:
        """Wait for all submitted calls; after an exception, kill the processes instead."""
        if error is not None:
            self.kill()
        return super().__exit__(cls, error, traceback)


def _initialize_worker() -> None:
    """Ignore Ctrl-C, limit threads, and start the thread that ends this process with its parent process."""
    for variable in THREAD_COUNT_VARIABLES:
        os.environ.setdefault(variable, "1")
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    threading.Thread(target=_exit_with_parent, name="exit with parent", daemon=True).start()
    # A process of a pool calls its finalizers when it ends, before it waits for its threads.
    multiprocessing_util.Finalize(None, limit_end_time, exitpriority=0)


def _exit_with_parent() -> None:
    """Wait until the parent process has ended, then exit without cleanup."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    # `join` waits for the parent process, not for the thread that started this process.
    parent.join()
    os._exit(1)


def limit_end_time(exit_code: int = 0) -> None:
    """Let this process, which is about to end, end after `MAX_END_TIME` although a thread still runs."""

    def end_process() -> None:
        time.sleep(MAX_END_TIME)
        threads = {*threading.enumerate()} - {threading.main_thread()}
        names = sorted(f'"{thread.name}"' for thread in threads if not thread.daemon)
        problem = f"still running after {MAX_END_TIME:.0f} s: {', '.join(names)}"
        try:
            note = f"note: the process ends without waiting for its threads, {problem}\n"
            sys.stderr.write(shorten_quotations(note))
            sys.stderr.flush()
        finally:
            os._exit(exit_code)

    threading.Thread(target=end_process, name="end process", daemon=True).start()


def shut_down(pool: ThreadPoolExecutor) -> bool:
    """Cancel the pending calls of a pool; return True if the running call ends within `MAX_END_TIME`."""
    waiter = threading.Thread(target=pool.shutdown, kwargs={"cancel_futures": True}, daemon=True)
    waiter.start()
    waiter.join(MAX_END_TIME)
    return not waiter.is_alive()


def build_command(module: str, *arguments: str) -> list[str]:
    """Return the command that runs a module with the interpreter of this process.

    `python -m` would import libraries from the working directory if a file there had the name of a library.
    """
    # With `-c`, `sys.path` contains "", the working directory; the script removes the entry.
    script = (
        "import sys; sys.path[:] = filter(None, sys.path); "
        "module = sys.argv.pop(1); import runpy; runpy.run_module(module, None, '__main__')"
    )
    return [sys.executable, "-c", script, module, *arguments]


def wait_until_done(future: Future[Any]) -> None:
    """Wait until another thread has computed a result or raised an exception."""
    while not future.done():
        wait([future], MAX_BLOCKING_TIME)


@contextmanager
def shorten_collections() -> Iterator[None]:
    """Exclude all existing objects from garbage collection until the context ends.

    Otherwise a collection of all objects would take 0.1 s of a control step.
    """
    start_threshold, *_ = gc.get_threshold()
    gc.freeze()
    gc.set_threshold(CONTROL_THRESHOLD)
    try:
        yield
    finally:
        gc.set_threshold(start_threshold)
        gc.unfreeze()
