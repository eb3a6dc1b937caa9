"""One after the other."""

from __future__ import annotations

from py_trees.common import Status

from executive.tree.node import ControlNode


class Sequence(ControlNode):
    """Runs its children one after the other; fails with the first that fails, succeeds with the last.

    It remembers where it is: a child that succeeded is not run again.
    """

    word = "sequence"

    def start(self) -> None:
        """Begin with the first child."""
        self._next = 0

    def step(self) -> Status:
        """Tick the current child; go on to the next in the same tick."""
        while self._next < len(self.children):
            child = self.children[self._next]
            status = self.run_child(child)
            if status is Status.RUNNING:
                return status
            if status is Status.FAILURE:
                return self.fail(self.failure_of(child))
            self._next += 1
        return Status.SUCCESS
