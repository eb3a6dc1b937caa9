"""The next best."""

from __future__ import annotations

from py_trees.common import Status

from executive.tree.node import ControlNode


class Fallback(ControlNode):
    """Runs its children one after the other until one succeeds; fails with the last one's failure.

    It remembers where it is: a child that failed is not run again. Every failure that it passes over
    is told to the observers.
    """

    word = "fallback"

    def start(self) -> None:
        """Begin with the first child."""
        self._next = 0

    def step(self) -> Status:
        """Tick the current child; go on to the next in the same tick."""
        while True:
            child = self.children[self._next]
            status = self.run_child(child)
            if status is not Status.FAILURE:
                return status
            failure = self.failure_of(child)
            self._next += 1
            if self._next == len(self.children):
                return self.fail(failure)
            self.choose(f"choice {self._next + 1} of {len(self.children)}", failure)
