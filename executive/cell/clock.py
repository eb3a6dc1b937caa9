"""Length of a control step, and a clock that gets its time from a function."""

from __future__ import annotations

from collections.abc import Callable, Iterator

STEP = 1 / 240
"""Length of one control step, and of one physics step of the simulation [s]."""


class StepClock:
    """Clock that gets its time from a function; implements `executive.cell.protocols.Clock`.

    Args:
        read: Returns the time since the run began [s].
        step: Length of one control step [s].
    """

    def __init__(self, read: Callable[[], float], step: float = STEP) -> None:
        self._read = read
        self.step = step

    @property
    def now(self) -> float:
        """Time since the run began [s]."""
        return self._read()

    def sleep(self, duration: float) -> Iterator[None]:
        """Yield until `duration` [s] has passed on this clock."""
        end = self.now + duration
        while self.now < end - self.step / 2:
            yield
