"""Again after a success."""

from __future__ import annotations

from collections.abc import Sequence

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.errors import InputError
from executive.tree.loop import Rounds
from executive.tree.node import Site


class Repeat(Rounds):
    """Runs its body again and again: `times` times, or `until` it fails in one of these ways.

    Where both are given, whichever comes first ends it. Ending so is success; any other failure of
    the body is passed on.

    Raises:
        InputError: `times` is negative.
    """

    word = "repeat"

    def __init__(
        self, site: Site, body: Behaviour, times: int | None = None, until: Sequence[tuple[str, str]] = ()
    ) -> None:
        if times is not None and times < 0:
            raise InputError(f"{site.path}: a body can be repeated 0 times or more, not {times} times")
        super().__init__(site, [body])
        self._body, self._times, self._until = body, times, tuple(until)

    @property
    def detail(self) -> str:
        """What ends it."""
        ends = [] if self._times is None else [f"{self._times} times"]
        if self._until:
            ends.append(f"until {', '.join('.'.join(name) for name in self._until)}")
        return " or ".join(ends)

    def start(self) -> None:
        """Begin the first round."""
        super().start()
        self._done = 0

    def step(self) -> Status:
        """Tick the body; begin the next round in the same tick if this one took time."""
        while self._done != self._times:
            status = self.run_round(self._body)
            if status is Status.RUNNING:
                return status
            if status is Status.FAILURE:
                failure = self.failure_of(self._body)
                if not failure.matches(self._until):
                    return self.fail(failure)
                self.choose("done", failure)
                return Status.SUCCESS
            self._done += 1
            if not self.next_round() and self._done != self._times:
                return Status.RUNNING
        return Status.SUCCESS
