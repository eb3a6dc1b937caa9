"""Signals that end a command or halt a run: Ctrl-C, SIGTERM and SIGHUP."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType

from executive.run.run_control import RunControl

TERMINATION = (signal.SIGTERM, signal.SIGHUP)
"""Signals other than Ctrl-C that ask a process to end."""
SIGNALS = (signal.SIGINT, *TERMINATION)
"""Signals that halt a run."""


@contextmanager
def handle_signals(
    numbers: Sequence[int], handler: Callable[[int, FrameType | None], None]
) -> Iterator[Callable[[], None]]:
    """Handle signals, and yield a function that restores the former handlers.

    SIGTERM and SIGHUP stay ignored if they were ignored at the start of the process (`nohup`). SIGINT does
    not: workers ignore it while they wait, and a run in a worker must halt. Outside the main thread no signal
    is handled, because Python does not allow it.
    """
    former = {}
    if threading.current_thread() is threading.main_thread():
        former = {number: signal.getsignal(number) for number in numbers}
        former = {n: old for n, old in former.items() if n == signal.SIGINT or old is not signal.SIG_IGN}

    def restore() -> None:
        for number, old in former.items():
            signal.signal(number, old)

    for number in former:
        signal.signal(number, handler)
    try:
        yield restore
    finally:
        restore()


@contextmanager
def stopped_by_signals(control: RunControl) -> Iterator[None]:
    """Halt the run at the first signal; a second signal has its former effect."""

    def halt(number: int, frame: FrameType | None) -> None:
        del number, frame
        control.stop()
        restore()

    with handle_signals(SIGNALS, halt) as restore:
        yield
