"""Base class of loops."""

from __future__ import annotations

from py_trees.common import Status

from executive.tree.keys import Child
from executive.tree.node import ControlNode


class Loop(ControlNode):
    """Base of the loops: runs rounds and records whether a round took time.

    After a round that began and ended within one tick, the next round waits for the next tick; otherwise a
    body that always ends at once would keep the tick from ending. After a round that took time, the next
    round begins in the same tick, so that a loop causes no idle ticks.

    Attributes:
        took_time: True if the current round was RUNNING at the end of a tick.
    """

    symbol, shape = "↻", "hexagon"

    def start(self) -> None:
        """Begin the first round."""
        self.took_time = False

    def run_round(self, child: Child) -> Status:
        """Tick a child as part of the current round."""
        status = self.run_child(child)
        if status is Status.RUNNING:
            self.took_time = True
        return status

    def begin_round(self) -> bool:
        """Begin the next round; return True if the last round took time and the next may run in this tick."""
        took_time, self.took_time = self.took_time, False
        return took_time
