"""As long as."""

from __future__ import annotations

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.loop import Rounds
from executive.tree.node import Site


class While(Rounds):
    """Runs its condition, and while that succeeds its body, and so on.

    Ends with success when the condition fails; a failure of the body is passed on.
    """

    word = "while"

    def __init__(self, site: Site, condition: Behaviour, body: Behaviour) -> None:
        super().__init__(site, [condition, body])
        self._condition, self._body = condition, body

    def start(self) -> None:
        """Begin with the condition."""
        super().start()
        self._current = self._condition

    def step(self) -> Status:
        """Tick what is under way; begin the next round in the same tick if this one took time."""
        while True:
            current = self._current
            status = self.run_round(current)
            if status is Status.RUNNING:
                return status
            if status is Status.FAILURE:
                failure = self.failure_of(current)
                if current is self._body:
                    return self.fail(failure)
                self.choose("done", failure)
                return Status.SUCCESS
            if current is self._condition:
                self._current = self._body
            else:
                self._current = self._condition
                if not self.next_round():
                    return Status.RUNNING
