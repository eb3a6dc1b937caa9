"""Beside something else, for as long as that takes."""

from __future__ import annotations

from py_trees.common import Status

from executive.tree.node import ControlNode


class Beside(ControlNode):
    """Ticks its first child, the lead, and the others beside it until the lead has ended.

    It ends as the lead does, in the same tick; what still runs then is halted. One of the others that ends
    before is not run again, and its failure, told to the observers, changes nothing.
    """

    word = "parallel"

    @property
    def detail(self) -> str:
        """What it waits for."""
        return "wait for the lead"

    def start(self) -> None:
        """Begin with all children."""
        self._others = list(self.children[1:])

    def step(self) -> Status:
        """Tick the lead, and unless it ended the others that still run."""
        lead = self.children[0]
        status = self.run_child(lead)
        if status is not Status.RUNNING:
            self.halt_children(self._others)
            return status if status is Status.SUCCESS else self.fail(self.failure_of(lead))
        for child in list(self._others):
            ended = self.run_child(child)
            if ended is not Status.RUNNING:
                self._others.remove(child)
            if ended is Status.FAILURE:
                self.choose("go on without it", self.failure_of(child))
        return Status.RUNNING
