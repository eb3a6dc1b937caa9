"""What a person does to a run from outside: stop it, pause it, let it go on or step, ask for things."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable

SLICE = 0.05
"""Longest time a pause holds the tick thread at once [s]: a signal is handled in between."""


class RunControl:
    """Wishes for a run, made from any thread or a signal handler and heeded between two ticks.

    A pause lets the run's clock stand still: in simulation the world stands still, too, in mid-motion.
    """

    def __init__(self) -> None:
        self._stopped = False
        self._paused = False
        self._steps = 0
        self._change = threading.Event()
        self._requests: deque[str] = deque()
        self._between: list[Callable[[], None]] = []

    @property
    def stopped(self) -> bool:
        """True from the moment somebody wanted the run to end."""
        return self._stopped

    @property
    def paused(self) -> bool:
        """True while the run is to stand still."""
        return self._paused and not self._stopped

    def stop(self) -> None:
        """Let the run halt: its tree is ended and the arm braked."""
        self._stopped = True
        self._change.set()

    def pause(self) -> None:
        """Let the run stand still before its next tick."""
        self._paused = True

    def resume(self) -> None:
        """Let the run go on."""
        self._paused, self._steps = False, 0
        self._change.set()

    def step(self, ticks: int = 1) -> None:
        """Let the run take so many ticks more and stand still again; it pauses if it did not."""
        self._steps = self._steps + ticks if self._paused else ticks
        self._paused = True
        self._change.set()

    def request(self, word: str) -> None:
        """Answer the question what is to be picked; what is said before it is asked counts for nothing."""
        self._requests.append(word)

    def requested(self) -> str | None:
        """Return the next word that was asked for, once; None where there is none."""
        return self._requests.popleft() if self._requests else None

    def between_ticks(self, do: Callable[[], None]) -> None:
        """Have something done between any two ticks, and now and then while the run stands still.

        It is done on the tick thread, where the cell may be looked at, and must return at once.
        """
        self._between.append(do)

    def wait(self) -> None:
        """Return when the next tick may begin, or the run is to halt."""
        for do in self._between:
            do()
        while self._paused and not self._stopped:
            if self._steps > 0:
                self._steps -= 1
                return
            self._change.wait(SLICE)
            self._change.clear()
            for do in self._between:
                do()
