"""What a skill does behind the cell's back: threads, files and processes left, looks at the wall clock."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

_CLOCKS = (
    "time", "time_ns", "monotonic", "monotonic_ns", "perf_counter", "perf_counter_ns", "process_time",
    "sleep",
)  # fmt: skip
_MAY = ("logging",)
"""Packages that may look at the clock: nothing is decided by it."""


def open_things() -> set[str]:
    """Return a line for every thread, open file and child process of this process."""
    threads = {f'the thread "{thread.name}" ({id(thread)})' for thread in threading.enumerate()}
    return threads | _files() | _children()


@contextmanager
def clocks_watched(seen: list[str]) -> Iterator[None]:
    """Note in `seen` who asks the wall clock in this thread, as `time.sleep in wave.py:12`; nobody sleeps."""
    watched = threading.get_ident()

    def noted(name: str, clock: Callable[..., Any]) -> Callable[..., Any]:
        def asked(*arguments: Any) -> Any:
            asker = sys._getframe(1)
            package = str(asker.f_globals.get("__name__", "")).partition(".")[0]
            if threading.get_ident() != watched or package in _MAY:
                return clock(*arguments)
            place = f"{Path(asker.f_code.co_filename).name}:{asker.f_lineno}"
            seen.append(f"time.{name} in {place}")
            return None if name == "sleep" else clock(*arguments)

        return asked

    true = {name: getattr(time, name) for name in _CLOCKS}
    for name, clock in true.items():
        setattr(time, name, noted(name, clock))
    try:
        yield
    finally:
        for name, clock in true.items():
            setattr(time, name, clock)


def _files() -> set[str]:
    """Return the open files, the list of them left out."""
    found = set()
    for number in os.listdir("/dev/fd"):
        try:
            found.add(f"the open file {os.readlink(f'/dev/fd/{number}')} (number {number})")
        except OSError:
            continue
    return found


def _children() -> set[str]:
    """Return the child processes; to look for them takes long, so first whether there are any is asked."""
    try:
        os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT)
    except ChildProcessError:
        return set()
    found = set()
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            name, _, rest = path.read_text().rpartition(")")
        except OSError:
            continue
        if int(rest.split()[1]) == os.getpid():
            found.add(f"the process {name.partition('(')[2]} (number {path.parent.name})")
    return found
