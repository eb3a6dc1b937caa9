"""Loops that cannot spin inside one tick."""

from __future__ import annotations

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.node import ControlNode


class Rounds(ControlNode):
    """Base of the loops: ticks a body and knows whether a round took any time.

    A round that begins and ends within one tick has let no time pass, so the next one must wait for
    the next tick; otherwise a body that ends at once would hold the tick for ever. A round that took
    time is followed by the next within the same tick: a loop costs no idle ticks.

    Attributes:
        took_time: True once the current round has handed back a tick.
    """

    def start(self) -> None:
        """Begin the first round."""
        self.took_time = False

    def run_round(self, child: Behaviour) -> Status:
        """Tick a child as part of the current round."""
        status = self.run_child(child)
        if status is Status.RUNNING:
            self.took_time = True
        return status

    def next_round(self) -> bool:
        """Begin the next round; tell whether it may run in this tick, because the last one took time."""
        took_time, self.took_time = self.took_time, False
        return took_time
