"""`try`, `catch` and `finally` of a mission."""

from __future__ import annotations

from collections.abc import Sequence

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.failure import Failure
from executive.tree.node import ControlNode, Site

Handler = tuple[Sequence[tuple[str, str]], Behaviour]
"""Failures, and what to do instead after one of them."""


class Try(ControlNode):
    """Runs a body; after a failure that a `catch` names, that one instead; in the end `finally`.

    Succeeds if the body or the catch does. `finally` runs after success and failure, never after a
    halt or a fault; its own failure counts unless the node is failing already.
    """

    word = "try"

    def __init__(
        self, site: Site, body: Behaviour, handlers: Sequence[Handler] = (), finish: Behaviour | None = None
    ) -> None:
        behaviours = [behaviour for _, behaviour in handlers]
        super().__init__(site, [body, *behaviours, *([finish] if finish else [])])
        self._body, self._finish = body, finish
        self._handlers = tuple(handlers)

    def when(self, child: Behaviour) -> str:
        """Return after which failures a catch runs: `on Grasp.missed`."""
        names = next((names for names, behaviour in self._handlers if behaviour is child), ())
        return f"on {', '.join('.'.join(name) for name in names)}" if names else ""

    def start(self) -> None:
        """Begin with the body."""
        self._current = self._body
        self._pending: Failure | None = None

    def step(self) -> Status:
        """Tick what is under way; go on to what follows in the same tick."""
        while True:
            current = self._current
            status = self.run_child(current)
            if status is Status.RUNNING:
                return status
            failure = self.failure_of(current) if status is Status.FAILURE else None
            if current is self._finish:
                # What went wrong before is the better explanation.
                return self._result(self._pending or failure)
            if failure is not None and current is self._body and (handler := self._handler(failure)):
                self.choose("catch", failure)
                self._current = handler
            elif self._finish is not None:
                self._pending = failure
                self._current = self._finish
            else:
                return self._result(failure)

    def _result(self, failure: Failure | None) -> Status:
        return Status.SUCCESS if failure is None else self.fail(failure)

    def _handler(self, failure: Failure) -> Behaviour | None:
        return next((behaviour for names, behaviour in self._handlers if failure.matches(names)), None)
