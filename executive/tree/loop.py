"""Base class of loops."""

from __future__ import annotations

from py_trees.common import Status

from executive.tree.keys import Child
from executive.tree.node import ControlNode


class Loop(ControlNode):
    """Base class of loops: runs iterations, and records whether an iteration took at least one tick.

    After an iteration that began and ended within one tick, the next iteration waits for the next tick;
    otherwise a body that always ends at once would keep the tick from ending. After a longer iteration, the
    next iteration begins in the same tick, so that a loop causes no idle ticks.

    Attributes:
        was_running: True if the current iteration was RUNNING at the end of a tick.
    """

    symbol, shape = "↻", "hexagon"

    def start(self) -> None:
        """Begin the first iteration."""
        self.was_running = False

    def run_iteration(self, child: Child) -> Status:
        """Tick a child as part of the current iteration."""
        status = self.run_child(child)
        if status is Status.RUNNING:
            self.was_running = True
        return status

    def begin_iteration(self) -> bool:
        """Begin the next iteration; return True if it may run in the current tick."""
        was_running, self.was_running = self.was_running, False
        return was_running
