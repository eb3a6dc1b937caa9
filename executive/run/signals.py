"""Handling of the signals that end a command or halt a run: SIGINT (Ctrl-C), SIGTERM and SIGHUP."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType

from executive.run.run_control import RunControl

TERMINATION_SIGNALS = (signal.SIGTERM, signal.SIGHUP)
"""Signals other than SIGINT that request the end of a process."""
HALT_SIGNALS = (signal.SIGINT, *TERMINATION_SIGNALS)
"""Signals that halt a run."""


@contextmanager
def handle_signals(
    numbers: Sequence[int], handler: Callable[[int, FrameType | None], None]
) -> Iterator[Callable[[], None]]:
    """Handle signals in the `with` block, and yield a function that restores the previous handlers.

    Ignored signals stay ignored (`nohup`), except SIGINT: a worker process ignores SIGINT while it waits, but
    SIGINT must halt a run in a worker process. In other threads than the main thread, the function handles no
    signal, because Python does not allow it.
    """
    previous = {}
    if threading.current_thread() is threading.main_thread():
        previous = {number: signal.getsignal(number) for number in numbers}
        previous = {n: old for n, old in previous.items() if n == signal.SIGINT or old is not signal.SIG_IGN}

    def restore() -> None:
        for number, handler_before in previous.items():
            signal.signal(number, handler_before)

    for number in previous:
        signal.signal(number, handler)
    try:
        yield restore
    finally:
        restore()


@contextmanager
def halt_on_signals(control: RunControl) -> Iterator[None]:
    """Stop the run at the first signal; a second signal has the effect that it has outside the block."""

    def stop_run(number: int, frame: FrameType | None) -> None:
        del number, frame
        control.stop()
        restore()

    with handle_signals(HALT_SIGNALS, stop_run) as restore:
        yield
