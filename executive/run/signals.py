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
    signal_numbers: Sequence[int], handler: Callable[[int, FrameType | None], None]
) -> Iterator[Callable[[], None]]:
    """Handle signals in the `with` block, and yield a function that restores the previous handlers.

    A signal that the process ignores stays ignored (`nohup`), except SIGINT: a waiting worker process ignores
    SIGINT, but SIGINT must halt a run. Python allows no handlers outside the main thread.
    """
    previous_handlers = {}
    if threading.current_thread() is threading.main_thread():
        for number in signal_numbers:
            if number == signal.SIGINT or signal.getsignal(number) is not signal.SIG_IGN:
                previous_handlers[number] = signal.signal(number, handler)

    def restore() -> None:
        for number, previous_handler in previous_handlers.items():
            signal.signal(number, previous_handler)

    try:
        yield restore
    finally:
        restore()


@contextmanager
def halt_on_signals(control: RunControl) -> Iterator[None]:
    """Stop the run at the first signal; a second signal goes to the handler from before the `with` block."""

    def stop_run(number: int, frame: FrameType | None) -> None:
        del number, frame
        control.stop()
        restore()

    with handle_signals(HALT_SIGNALS, stop_run) as restore:
        yield
