"""Control of a run from outside: pause, step, resume, stop, and requests of the operator."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable

PAUSE_POLL_PERIOD = 0.05
"""Longest time for which a pause blocks the tick thread without handling signals [s]."""


class RunControl:
    """Commands to a run, from any thread or a signal handler; they take effect between two ticks.

    During a pause the clock of the run stands still, and so does a simulated world.
    """

    def __init__(self) -> None:
        self._stopped = False
        self._paused = False
        self._steps = 0
        self._change = threading.Event()
        self._requests: deque[str] = deque()
        self._callbacks: list[Callable[[], None]] = []

    @property
    def stopped(self) -> bool:
        """True after the first call of `stop`."""
        return self._stopped

    @property
    def paused(self) -> bool:
        """True while the run is paused or takes single steps."""
        return self._paused and not self._stopped

    def stop(self) -> None:
        """Halt the run: its tree is halted and its arm brakes."""
        self._stopped = True
        self._change.set()

    def pause(self) -> None:
        """Pause the run before its next tick."""
        self._paused = True

    def resume(self) -> None:
        """End the pause."""
        self._paused, self._steps = False, 0
        self._change.set()

    def step(self, ticks: int = 1) -> None:
        """Let the run tick `ticks` times, then pause it."""
        self._steps = self._steps + ticks if self._paused else ticks
        self._paused = True
        self._change.set()

    def request(self, word: str) -> None:
        """Answer the present question to the operator; an answer without a question is ignored."""
        self._requests.append(word)

    def take_request(self) -> str | None:
        """Remove and return the oldest answer; None if there is none."""
        return self._requests.popleft() if self._requests else None

    def between_ticks(self, callback: Callable[[], None]) -> None:
        """Call `callback` between any two ticks, and repeatedly during a pause.

        The callback runs on the tick thread, may read the cell, and must return at once.
        """
        self._callbacks.append(callback)

    def wait(self) -> None:
        """Return when the next tick may begin, or when the run has to halt."""
        for callback in self._callbacks:
            callback()
        while self._paused and not self._stopped:
            if self._steps > 0:
                self._steps -= 1
                return
            self._change.wait(PAUSE_POLL_PERIOD)
            self._change.clear()
            for callback in self._callbacks:
                callback()
