"""Clock that reads its time from a function, and the duration of a control step."""

from __future__ import annotations

from collections.abc import Callable, Iterator

STEP = 1 / 240
"""Duration of one control step, and of one physics step of the simulation [s]."""


class StepClock:
    """Clock that reads its time from a function; implements `executive.cell.protocols.Clock`.

    Args:
        get_time: Function that returns the time since the start of the run [s].
        step: Duration of one control step [s].
    """

    def __init__(self, get_time: Callable[[], float], step: float = STEP) -> None:
        self._get_time = get_time
        self.step = step

    @property
    def now(self) -> float:
        """Time since the start of the run [s]."""
        return self._get_time()

    def sleep(self, duration: float) -> Iterator[None]:
        """Yield until the time of the clock has advanced by `duration` [s]."""
        end = self.now + duration
        while self.now < end - self.step / 2:
            yield
