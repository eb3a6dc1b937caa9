"""Ctrl-C and SIGTERM during a run."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from executive.runtime.run_control import RunControl

SIGNALS = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def stopped_by_signals(control: RunControl) -> Iterator[None]:
    """Turn the first Ctrl-C (or SIGTERM) into a wish to halt; the second does what it did before.

    Outside the main thread signals are left alone: Python allows nothing else.
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

    previous = {number: signal.getsignal(number) for number in SIGNALS}
    for number in SIGNALS:
        signal.signal(number, wish)
    try:
        yield
    finally:
        restore()
