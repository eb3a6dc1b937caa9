"""Control of a run from outside: pause, step, resume, stop, requests of the operator, and signals."""

from __future__ import annotations

import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from types import FrameType

PAUSE_POLL_PERIOD = 0.05
"""Period at which a paused run handles signals and calls the callbacks of `call_between_ticks` [s]."""
TERMINATION_SIGNALS = (signal.SIGTERM, signal.SIGHUP)
"""Signals other than SIGINT that request the end of a process."""
HALT_SIGNALS = (signal.SIGINT, *TERMINATION_SIGNALS)
"""Signals that halt a run."""


class RunControl:
    """Commands to a run from any thread or signal handler; a command takes effect between two ticks.

    During a pause, the clock of the run and a simulated world stand still.

    Attributes:
        is_stopped: True after the first call of `stop`.
        is_idle: True while `wait_while_paused` has nothing to do.
    """

    def __init__(self) -> None:
        self.is_stopped = False
        self.is_idle = True
        self._is_paused = False
        self._remaining_ticks = 0
        """Number of ticks that `step` requested and that have not begun."""
        self._wake_up = threading.Event()
        self._requests: deque[str] = deque()
        self._callbacks: list[Callable[[], None]] = []

    @property
    def is_paused(self) -> bool:
        """True if the run is paused or will pause after the ticks of `step`; False after `stop`."""
        return self._is_paused and not self.is_stopped

    def stop(self) -> None:
        """Stop the run: the run halts its tree and brakes its arm."""
        self.is_stopped = True
        self._wake_up.set()

    def pause(self) -> None:
        """Pause the run before its next tick."""
        self._is_paused = True
        self.is_idle = False

    def resume(self) -> None:
        """End the pause."""
        self._is_paused = False
        self._remaining_ticks = 0
        self._wake_up.set()

    def step(self, tick_count: int = 1) -> None:
        """Let the run tick `tick_count` times, and then pause the run."""
        # If the run is not paused, no ticks remain, because `resume` sets their number to 0.
        self._remaining_ticks += tick_count
        self._is_paused = True
        self.is_idle = False
        self._wake_up.set()

    def add_request(self, text: str) -> None:
        """Store a request of the operator; `TerminalOperator` ignores requests that precede its question."""
        self._requests.append(text)

    def take_request(self) -> str | None:
        """Remove and return the oldest request; return None if there is no request."""
        return self._requests.popleft() if self._requests else None

    def call_between_ticks(self, callback: Callable[[], None]) -> None:
        """Call `callback` between any two ticks, and periodically during a pause.

        The callback runs in the thread of the tick loop, may read the cell, and must return at once.
        """
        self._callbacks.append(callback)
        self.is_idle = False

    def wait_while_paused(self) -> None:
        """Call the callbacks; in a pause, wait for `resume` or `stop`, or begin a tick of `step`."""
        while True:
            for callback in self._callbacks:
                callback()
            if not self.is_paused:
                return
            if self._remaining_ticks > 0:
                self._remaining_ticks -= 1
                return
            self._wake_up.wait(PAUSE_POLL_PERIOD)
            self._wake_up.clear()


@contextmanager
def handle_signals(
    signal_numbers: Sequence[int], handler: Callable[[int, FrameType | None], None]
) -> Iterator[Callable[[], None]]:
    """Handle signals in the `with` block, and yield a function that restores the previous handlers.

    A signal that the process ignores stays ignored (`nohup`), except SIGINT: a waiting worker process ignores
    SIGINT, but SIGINT must halt a run. Python allows no handlers outside the main thread.
    """
    is_main_thread = threading.current_thread() is threading.main_thread()
    with ExitStack() as previous_handlers:
        for number in signal_numbers if is_main_thread else ():
            if number == signal.SIGINT or signal.getsignal(number) is not signal.SIG_IGN:
                previous_handlers.callback(signal.signal, number, signal.signal(number, handler))
        yield previous_handlers.close


@contextmanager
def halt_on_signals(control: RunControl) -> Iterator[None]:
    """Stop the run at the first signal; a second signal goes to the handler from before the `with` block."""

    def stop_run(number: int, frame: FrameType | None) -> None:
        del number, frame
        control.stop()
        restore()

    with handle_signals(HALT_SIGNALS, stop_run) as restore:
        yield
