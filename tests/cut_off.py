"""Runs that end as a kill ends them."""

from __future__ import annotations

from executive.errors import Interrupted
from executive.events import TimedEvent
from tests.benchmarks.report import SilentView


class Cut(Interrupted):
    """Ends a run as a kill does, but for what Python itself closes."""


class Cutter(SilentView):
    """A view that ends the process at the n-th event of a control step, or the first one after it."""

    def __init__(self, tick: int = 10**9, nth: int = 1) -> None:
        self._tick, self._nth = tick, nth

    def __call__(self, timed: TimedEvent) -> None:
        if timed.tick >= self._tick:
            self._nth -= 1
            if self._nth == 0:
                raise Cut
