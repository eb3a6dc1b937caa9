"""Not longer than."""

from __future__ import annotations

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.cell.protocols import Clock
from executive.tree.node import ControlNode, Site


class Timeout(ControlNode):
    """Runs a body that must end within `seconds` [s] on the run's clock, else fails with `timeout`.

    A body that ends in the very tick in which its time is up has made it.
    """

    word = "timeout"

    def __init__(self, site: Site, body: Behaviour, seconds: float, clock: Clock) -> None:
        super().__init__(site, [body])
        self._body, self._seconds, self._clock = body, seconds, clock

    @property
    def detail(self) -> str:
        """How long."""
        return f"{self._seconds:g} s"

    def start(self) -> None:
        """Begin to count."""
        self._deadline = self._clock.now + self._seconds

    def step(self) -> Status:
        """Tick the body, then look at the clock."""
        status = self.run_child(self._body)
        if status is Status.FAILURE:
            return self.fail(self.failure_of(self._body))
        # A nanosecond of slack: a clock that adds up steps may miss the deadline by rounding.
        if status is Status.RUNNING and self._clock.now >= self._deadline - 1e-9:
            self.halt_children([self._body])
            return self.fail_for("timeout", f"not done after {self._seconds:g} s")
        return status
