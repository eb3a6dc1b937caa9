"""Further attempts after a failure."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, isfinite

from py_trees.common import Status

from executive.cell.protocols import Steps
from executive.skill import Seconds
from executive.tree.failure import Failure
from executive.tree.flow import Enter, Flow, FlowState, PossibleFailure, find_fixed_point, join_states
from executive.tree.inspection import (
    Advice,
    MinTimeFunction,
    NodeFacts,
    NodeFinding,
    PropagatedFailure,
    format_reasons,
)
from executive.tree.keys import Child, KeySection, Reasons, key
from executive.tree.loop import Loop


class Backoff(KeySection):
    """Waiting times that grow from one failure to the next."""

    first: Seconds = key(gt=0, shorthand=True, doc="Wait before the second attempt [s].")
    factor: float = key(default=1.0, ge=1, doc="Ratio of each wait to the one before; 1 if not given.")
    most: Seconds = key(default=inf, gt=0, doc="Longest wait [s].")

    def __str__(self) -> str:
        factor = f", times {self.factor:g} each" if self.factor != 1 else ""
        limit = f", at most {self.most:g} s" if isfinite(self.most) else ""
        return f"{self.first:g} s{factor}{limit}"

    def compute_delay(self, attempt: int) -> float:
        """Return the wait after the failure of an attempt, counted from 1 [s]."""
        try:
            return min(self.first * self.factor ** (attempt - 1), self.most)
        except OverflowError:
            return self.most


class Retry(Loop):
    """Run a node again after a failure.

    Failures that `on` does not list, and the failure of the last attempt, are passed on. Before every further
    attempt, the node waits for `backoff` on the clock of the run and then runs `recover`; if `recover` fails,
    the retry fails with the failure from which it was recovering.
    """

    keyword = "retry"

    attempts: int = key(ge=1, doc="Maximum number of attempts, including the first.")
    on: Reasons = key(default=(), doc="Failures after which the body runs again; every failure if not given.")
    recover: Child | None = key(default=None, doc="Node to run before every further attempt.")
    backoff: Backoff | None = key(
        default=None, doc="Wait before every further attempt [s], or first, factor and most."
    )
    do: Child = key(doc="Body, run in every attempt.")

    @property
    def detail(self) -> str:
        """The number of attempts, their causes and the waits."""
        after = format_reasons(self.on) or "any failure"
        backoff = "" if self.backoff is None else f", backoff {self.backoff}"
        return f"up to {self.attempts} attempts, on {after}{backoff}"

    def start(self) -> None:
        """Begin the first attempt."""
        super().start()
        self._attempt = 1
        self._pending: Failure | None = None

    def step(self) -> Status:
        """Tick the current child; begin the next attempt in the same tick if the round took time."""
        while True:
            if self._pending is None:
                status = self.run_round(self.do)
                if status is not Status.FAILURE:
                    return status
                failure = self.failure_of(self.do)
                if self._attempt == self.attempts or (self.on and not failure.matches(self.on)):
                    return self.fail(failure)
                self._pending, self._wait = failure, self._begin_wait(failure)
            status = self._tick_recovery(self._pending)
            if status is not Status.SUCCESS:
                return status
            self._pending = None
            if not self.begin_round():
                return Status.RUNNING

    def _begin_wait(self, failure: Failure) -> Steps:
        """Report the next attempt; return the wait before it."""
        delay = 0.0 if self.backoff is None else self.backoff.compute_delay(self._attempt)
        self._attempt += 1
        delay_text = f" in {delay:g} s" if delay else ""
        self.report_choice(f"attempt {self._attempt} of {self.attempts}{delay_text}", failure)
        return self.clock.sleep(delay)

    def _tick_recovery(self, pending: Failure) -> Status:
        """Continue the wait, then tick the recovery; SUCCESS if the next attempt may begin."""
        if next(self._wait, self) is not self:
            self.took_time = True
            return Status.RUNNING
        if self.recover is None:
            return Status.SUCCESS
        status = self.run_round(self.recover)
        if status is Status.FAILURE:
            self.report_choice("give up: the recovery failed", self.failure_of(self.recover))
            return self.fail(pending)
        return status

    def flow(self, enter: Enter, state: FlowState) -> Flow:
        """Enter recovery and body in turn until no new state occurs."""
        recovery: list[Flow] = []
        waiting: FlowState | None = None

        def is_retried(failure: PossibleFailure) -> bool:
            return not self.on or failure.may_match(self.on)

        def next_entry(body: Flow) -> FlowState | None:
            nonlocal waiting
            recovery.clear()
            retried = (after.after_handling(one) for one, after in body.failures.items() if is_retried(one))
            waiting = join_states(retried) if self.attempts != 1 else None
            if waiting is None or self.recover is None:
                return waiting
            recovery.append(enter(self.recover, waiting))
            return recovery[0].success

        body, _ = find_fixed_point(enter, self.do, state, next_entry)
        given_up = join_states(after for flow in recovery for after in flow.failures.values())
        failures = {
            failure: after.join(given_up or after) if is_retried(failure) else after
            for failure, after in body.failures.items()
        }
        waits = waiting if self.backoff else None
        return Flow(
            body.success, failures, join_states((body.halted, *(flow.halted for flow in recovery), waits))
        )

    def min_time(self, min_time_of: MinTimeFunction) -> float:
        """Return the minimum time of one attempt [s]."""
        return min_time_of(self.do)

    def check(self, facts: NodeFacts) -> Iterator[NodeFinding]:
        """Find attempts that change nothing, and a single attempt."""
        skills = facts.skills()
        if not self.backoff and skills and not any(one is None or one.senses or one.moves for one in skills):
            message = "this retry changes nothing between its attempts: no node in it looks, moves or waits"
            hint = "Put a look or a motion into do or recover, or wait with backoff."
            yield NodeFinding("", "unchanging-retry", message, hint, is_warning=True)
        # The value of a param may differ in another run, so a param is not reported.
        if self.attempts == 1 and facts.is_literal("attempts"):
            message = "a retry with 1 attempt never runs its body again"
            yield NodeFinding("attempts", "unchanging-retry", message, is_warning=True)

    def explain_unreachable(self, child: Child) -> str:
        """Return the reason why the recovery never runs."""
        if child is not self.recover:
            return ""
        return (
            "there is only one attempt" if self.attempts == 1 else "" if self.on else "the body never fails"
        )

    def explain(self, failure: PropagatedFailure) -> str:
        """Return the failures of all attempts."""
        handled = dict(failure.handled)
        if self._has_given_up(failure):
            attempt, attempts = self.count_attempts(failure)
            last = f"{failure.last}: {failure.messages[failure.last]}"
            return f"gave up after attempt {attempt} of {attempts}: its recovery failed with {last}"
        if self.on and not failure.is_one_of(self.on):
            earlier = f"; failures before: {_format_counts(handled)}" if handled else ""
            return f"runs again only after {format_reasons(self.on)}{earlier}"
        handled[failure.reason] = handled.get(failure.reason, 0) + 1
        if self.attempts == 1:
            return "has no second attempt"
        return f"all {self.attempts} attempts failed: {_format_counts(handled)}"

    def count_attempts(self, failure: PropagatedFailure) -> tuple[int, int]:
        """Return the number of the failed attempt and the number of allowed attempts."""
        # `handled` counts every failed attempt but the last one, and also a failed recovery.
        return sum(failure.handled.values()) + (-1 if self._has_given_up(failure) else 1), self.attempts

    def advise(self, failure: PropagatedFailure) -> Iterator[Advice]:
        """Yield the advice to handle a failure in the recovery, or to allow more attempts."""
        attempts = self.attempts
        if self._has_given_up(failure):
            yield Advice(f"handle {failure.last} in the recovery", child=self.recover)
        elif (not self.on or failure.is_one_of(self.on)) and self.count_attempts(failure)[0] == attempts:
            yield Advice(f"allow more than {attempts} attempt{'s' * (attempts > 1)}", "attempts")

    def contingencies(self) -> Iterator[tuple[str, Child]]:
        """Yield the recovery."""
        if self.recover is not None:
            yield "recover", self.recover

    def _has_given_up(self, failure: PropagatedFailure) -> bool:
        return self.recover is not None and failure.has_failed(self.recover)


def _format_counts(handled: dict[str, int]) -> str:
    return ", ".join(f"{count} x {reason}" for reason, count in handled.items())
