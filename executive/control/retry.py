"""Again after a failure."""

from __future__ import annotations

from collections.abc import Sequence

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.control.failure import Failure
from executive.control.node import Site
from executive.control.rounds import Rounds


class Retry(Rounds):
    """Runs its body again after a failure, at most `attempts` times in all.

    Only failures `on` the list are tried again (an empty list means every failure); others, and the
    last one, are passed on. Before every further attempt `recover` runs, where there is one; if that
    fails, the retry fails with the failure it was recovering from.
    """

    word = "retry"

    def __init__(
        self,
        site: Site,
        body: Behaviour,
        attempts: int,
        on: Sequence[tuple[str, str]] = (),
        recover: Behaviour | None = None,
    ) -> None:
        super().__init__(site, [body] if recover is None else [recover, body])
        self._body, self._recover = body, recover
        self._attempts, self._on = attempts, tuple(on)

    @property
    def detail(self) -> str:
        """How often, and after which failures."""
        after = ", ".join(".".join(name) for name in self._on) or "any failure"
        return f"up to {self._attempts} attempts, on {after}"

    def start(self) -> None:
        """Begin the first attempt."""
        super().start()
        self._attempt = 1
        self._recovering: Failure | None = None

    def step(self) -> Status:
        """Tick the recovery or the attempt under way; begin the next in the same tick if time passed."""
        while True:
            if self._recovering is not None:
                status = self.run_round(self._recovery)
                if status is Status.RUNNING:
                    return status
                if status is Status.FAILURE:
                    self.choose("give up: the recovery failed", self.failure_of(self._recovery))
                    return self.fail(self._recovering)
                self._recovering = None
            else:
                status = self.run_round(self._body)
                if status is not Status.FAILURE:
                    return status
                failure = self.failure_of(self._body)
                if self._attempt == self._attempts or (self._on and not failure.matches(self._on)):
                    return self.fail(failure)
                self._attempt += 1
                self.choose(f"attempt {self._attempt} of {self._attempts}", failure)
                if self._recover is not None:
                    self._recovering = failure
                    continue
            if not self.took_time:
                self.begin_round()
                return Status.RUNNING
            self.begin_round()

    @property
    def _recovery(self) -> Behaviour:
        assert self._recover is not None
        return self._recover
