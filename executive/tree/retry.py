"""Again after a failure."""

from __future__ import annotations

from collections.abc import Sequence

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.cell.protocols import Clock, Steps
from executive.errors import InputError
from executive.tree.backoff import Backoff
from executive.tree.failure import Failure
from executive.tree.loop import Rounds
from executive.tree.node import Site


class Retry(Rounds):
    """Runs its body again after a failure, at most `attempts` times in all.

    Only failures `on` the list are tried again (an empty list means every failure); others, and the
    last one, are passed on. Before every further attempt it waits for `backoff` on the run's clock and
    then runs `recover`, where there are such; if `recover` fails, the retry fails with the failure it
    was recovering from.

    Raises:
        InputError: `attempts` is below 1, or there is a backoff and no clock.
    """

    word = "retry"

    def __init__(
        self,
        site: Site,
        body: Behaviour,
        attempts: int,
        on: Sequence[tuple[str, str]] = (),
        recover: Behaviour | None = None,
        backoff: Backoff | None = None,
        clock: Clock | None = None,
    ) -> None:
        if attempts < 1:
            raise InputError(f"{site.path}: a retry makes 1 attempt or more, not {attempts}")
        if backoff is not None and clock is None:
            raise InputError(f"{site.path}: a retry with a backoff needs a clock to wait on")
        super().__init__(site, [body] if recover is None else [recover, body])
        self._body, self._recover = body, recover
        self._attempts, self._on = attempts, tuple(on)
        self._backoff, self._clock = backoff, clock

    @property
    def detail(self) -> str:
        """How often, after which failures, and after what wait."""
        after = ", ".join(".".join(name) for name in self._on) or "any failure"
        backoff = "" if self._backoff is None else f", backoff {self._backoff}"
        return f"up to {self._attempts} attempts, on {after}{backoff}"

    def start(self) -> None:
        """Begin the first attempt."""
        super().start()
        self._attempt = 1
        self._pending: Failure | None = None

    def step(self) -> Status:
        """Tick what is under way; begin the next attempt in the same tick if time passed."""
        while True:
            if self._pending is None:
                status = self.run_round(self._body)
                if status is not Status.FAILURE:
                    return status
                failure = self.failure_of(self._body)
                if self._attempt == self._attempts or (self._on and not failure.matches(self._on)):
                    return self.fail(failure)
                self._pending, self._wait = failure, self._next_wait(failure)
            status = self._prepare(self._pending)
            if status is not Status.SUCCESS:
                return status
            self._pending = None
            if not self.next_round():
                return Status.RUNNING

    def _next_wait(self, failure: Failure) -> Steps:
        """Tell that there will be another attempt; return the wait before it."""
        delay = 0.0 if self._backoff is None else self._backoff.delay(self._attempt)
        self._attempt += 1
        when = f" in {delay:g} s" if delay else ""
        self.choose(f"attempt {self._attempt} of {self._attempts}{when}", failure)
        return iter(()) if self._clock is None else self._clock.sleep(delay)

    def _prepare(self, pending: Failure) -> Status:
        """Go on with the wait, then with the recovery."""
        if next(self._wait, self) is not self:
            self.took_time = True
            return Status.RUNNING
        if self._recover is None:
            return Status.SUCCESS
        status = self.run_round(self._recover)
        if status is Status.FAILURE:
            self.choose("give up: the recovery failed", self.failure_of(self._recover))
            return self.fail(pending)
        return status
