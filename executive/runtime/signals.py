"""Ctrl-C, SIGTERM and SIGHUP during a run."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from executive.runtime.run_control import RunControl

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextmanager
def stopped_by_signals(control: RunControl) -> Iterator[None]:
    """Let the first of these signals halt the run; the second one does what it did before.

    A SIGTERM or SIGHUP that was ignored at the start of the process (`nohup`) stays ignored. Python handles
    signals in the main thread alone.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def wish(number: int, frame: FrameType | None) -> None:
        del number, frame
        control.stop()
        restore()

    def restore() -> None:
        for number, handler in previous.items():
            signal.signal(number, handler)

    ignored = {number for number in SIGNALS[1:] if signal.getsignal(number) is signal.SIG_IGN}
    previous = {number: signal.getsignal(number) for number in SIGNALS if number not in ignored}
    for number in previous:
        signal.signal(number, wish)
    try:
        yield
    finally:
        restore()
