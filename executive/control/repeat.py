"""Again after a success."""

from __future__ import annotations

from collections.abc import Sequence

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.control.node import Site
from executive.control.rounds import Rounds


class Repeat(Rounds):
    """Runs its body again and again: `times` times, or `until` it fails in one of these ways.

    Ending so is success; any other failure of the body is passed on.
    """

    word = "repeat"

    def __init__(
        self,
        site: Site,
        body: Behaviour,
        times: int | None = None,
        until: Sequence[tuple[str, str]] = (),
    ) -> None:
        super().__init__(site, [body])
        self._body, self._times, self._until = body, times, tuple(until)

    @property
    def detail(self) -> str:
        """What ends it."""
        if self._times is not None:
            return f"{self._times} times"
        return f"until {', '.join('.'.join(name) for name in self._until)}"

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
            idle = not self.took_time
            self.begin_round()
            if idle and self._done != self._times:
                return Status.RUNNING
        return Status.SUCCESS
