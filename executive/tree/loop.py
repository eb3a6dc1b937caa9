"""Base class of loops."""

from __future__ import annotations

from py_trees.common import Status

from executive.tree.keys import Child
from executive.tree.node import ControlNode


class Loop(ControlNode):
    """Base class of loops, with the rule when the next iteration may begin.

    After an iteration that took only one tick, the next iteration begins in the next tick, so that a loop
    never blocks a tick. In the tick in which a longer iteration ends, the next iteration begins.

    Attributes:
        has_tick_passed: True if at least one tick has ended during the current iteration.
    """

    symbol, shape = "↻", "hexagon"

    def start(self) -> None:
        """Begin the first iteration."""
        self.has_tick_passed = False

    def tick_in_iteration(self, child: Child) -> Status:
        """Tick a child as part of the current iteration."""
        status = self.tick_child(child)
        if status is Status.RUNNING:
            self.has_tick_passed = True
        return status

    def begin_iteration(self) -> bool:
        """Begin the next iteration; return True if the iteration may run in the current tick."""
        may_run, self.has_tick_passed = self.has_tick_passed, False
        return may_run
