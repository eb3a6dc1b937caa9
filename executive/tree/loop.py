"""Base class of loops."""

from __future__ import annotations

from py_trees.common import Status

from executive.tree.keys import Child
from executive.tree.node import ControlNode


class Loop(ControlNode):
    """Base of the loops: runs rounds and knows whether a round took any time.

    A round that begins and ends within one tick lets no time pass, so the next round waits for the next
    tick; otherwise a body that ends at once would never end the tick. A round that took time is followed by
    the next within the same tick: a loop costs no idle ticks.

    Attributes:
        took_time: True once the current round was RUNNING at the end of a tick.
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

    def next_round(self) -> bool:
        """Begin the next round; return True if it may run in this tick, because the last one took time."""
        took_time, self.took_time = self.took_time, False
        return took_time
