"""Side by side."""

from __future__ import annotations

from collections.abc import Sequence

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.errors import InputError
from executive.tree.failure import Failure
from executive.tree.node import ControlNode, Site


class Parallel(ControlNode):
    """Ticks all its children side by side until `wait_for` of them have succeeded (None: all).

    Every tick goes to each child that still runs, in order; one that ended is not run again. What to
    do is decided once all of them were ticked:

    * Enough have succeeded: success, whatever failed in the same tick; what still runs is halted.
    * Too many have failed for enough to succeed: the others may finish first, or are halted at once
      with `halt`. Then it fails with the failure that came first, in the same tick with that of the
      first child. An arm that a sibling moves is so not stopped in mid-air.

    Every other failure is told to the observers.

    Raises:
        InputError: `wait_for` is not between 1 and the number of children.
    """

    word = "parallel"

    def __init__(
        self, site: Site, children: Sequence[Behaviour], wait_for: int | None = None, halt: bool = False
    ) -> None:
        if wait_for is not None and not 1 <= wait_for <= len(children):
            raise InputError(
                f"{site.path}: a parallel of {len(children)} can wait for 1 to {len(children)} "
                f"of them, not for {wait_for}"
            )
        super().__init__(site, children)
        self._wait_for = len(children) if wait_for is None else wait_for
        self._halt = halt

    @property
    def detail(self) -> str:
        """How many it waits for, and whether a failure halts the others."""
        count = len(self.children)
        wait = "wait for all" if self._wait_for == count else f"wait for {self._wait_for} of {count}"
        return f"{wait}, halt" if self._halt else wait

    def start(self) -> None:
        """Begin with all children."""
        self._running = list(self.children)
        self._missing = self._wait_for
        self._first: Failure | None = None

    def step(self) -> Status:
        """Tick every child that still runs."""
        ended = not self._running
        for child in self._running:
            if self.run_child(child) is not Status.RUNNING:
                ended = True
        return self._decide() if ended else Status.RUNNING

    def _decide(self) -> Status:
        """Count who ended in this tick, and say how to go on."""
        ticked = self._running
        self._running = [child for child in ticked if child.status is Status.RUNNING]
        self._missing -= sum(child.status is Status.SUCCESS for child in ticked)
        failures = [self.failure_of(child) for child in ticked if child.status is Status.FAILURE]
        self._first = next(iter(failures), None) if self._first is None else self._first
        if self._missing <= 0:
            self.halt_children(self._running)
            self._tell("enough others succeeded", failures)
            return Status.SUCCESS
        hopeless = self._missing > len(self._running)
        if self._running and not (hopeless and self._halt):
            self._tell("let the others finish, then fail" if hopeless else "go on with the others", failures)
            return Status.RUNNING
        self.halt_children(self._running)
        assert self._first is not None
        self._tell(f"fail with {self._first}", [other for other in failures if other is not self._first])
        return self.fail(self._first)

    def _tell(self, choice: str, failures: Sequence[Failure]) -> None:
        for failure in failures:
            self.choose(choice, failure)
