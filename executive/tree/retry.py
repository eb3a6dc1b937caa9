"""Loop with a maximum number of attempts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from math import inf, isfinite

from executive.skill import Seconds
from executive.tree.failure import format_reasons
from executive.tree.flow import Flow, FlowFunction, FlowState, PossibleFailure, find_fixed_point, join_states
from executive.tree.inspection import Advice, Counterpart, NodeAnalysis, NodeFinding, PropagatedFailure
from executive.tree.keys import Child, KeySection, Reasons, key
from executive.tree.loops import GeneratorNode, NodeRun

_GIVE_UP = "give up: the recovery failed"
"""Choice that a retry reports after a failure of its recovery."""


class Backoff(KeySection):
    """Geometrically growing delays before the second and all further attempts."""

    first: Seconds = key(gt=0, shorthand=True, doc="Delay before the second attempt [s].")
    factor: float = key(default=1.0, ge=1, doc="Ratio of each delay to the previous delay; 1 if not given.")
    max: Seconds = key(default=inf, gt=0, doc="Maximum delay [s].")

    def __str__(self) -> str:
        factor_text = f", factor {self.factor:g}" if self.factor != 1 else ""
        max_text = f", at most {self.max:g} s" if isfinite(self.max) else ""
        return f"{self.first:g} s{factor_text}{max_text}"

    def compute_delay(self, attempt: int) -> float:
        """Return the delay [s] after a failure of attempt number `attempt`, counted from 1."""
        try:
            return min(self.first * self.factor ** (attempt - 1), self.max)
        except OverflowError:  # The power exceeds the range of floats.
            return self.max


class Retry(GeneratorNode):
    """Run the body again after a failure.

    Failures that `on` does not list, and the failure of the last attempt, are passed on. Before every further
    attempt, the node waits for the delay `backoff` on the clock of the run and then runs `recover`; if
    `recover` fails, the node fails with the failure of the last attempt.

    * BehaviorTree.CPP: `RetryUntilSuccessful`; with `on`, `recover` or `backoff`, a custom node `retry`.
    * py_trees: `decorators.Retry`. Each attempt begins in a new tick, and there is no `on`, `recover` or
      `backoff`.
    """

    keyword = "retry"

    attempts: int = key(ge=1, doc="Maximum number of attempts, including the first.")
    on: Reasons = key(default=(), doc="Failures after which the body runs again; every failure if not given.")
    recover: Child | None = key(default=None, doc="Node to run before every further attempt.")
    backoff: Backoff | None = key(
        default=None, doc="Delay before every further attempt [s], or first, factor and max."
    )
    do: Child = key(doc="Body, run in every attempt.")

    @property
    def detail(self) -> str:
        """Maximum number of attempts, failures that cause further attempts, and delays, as a text."""
        reasons = format_reasons(self.on) or "any failure"
        backoff_text = "" if self.backoff is None else f", backoff {self.backoff}"
        return f"up to {self.attempts} attempts, on {reasons}{backoff_text}"

    def run(self) -> NodeRun:
        """Run the body until it succeeds or no attempt is left; between attempts, wait and run `recover`."""
        attempt = 1
        while True:
            failure = yield from self.run_child(self.do)
            if not failure or attempt == self.attempts or (self.on and not failure.matches(self.on)):
                return failure
            delay = 0.0 if self.backoff is None else self.backoff.compute_delay(attempt)
            delay_text = f" in {delay:g} s" if delay else ""
            attempt += 1
            self.report_choice(f"attempt {attempt} of {self.attempts}{delay_text}", failure)
            yield from self.clock.sleep(delay)
            if self.recover and (recovery_failure := (yield from self.run_child(self.recover))):
                self.report_choice(_GIVE_UP, recovery_failure)
                return failure
            yield from self.end_iteration()

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the possible outcomes, by fixed-point iteration over body and recovery."""

        def can_retry(failure: PossibleFailure) -> bool:
            return not self.on or failure.may_match(self.on)

        def compute_retry_state(body: Flow) -> FlowState | None:
            failures = body.failures.items() if self.attempts != 1 else ()
            return join_states(end.with_handled_failure(cause) for cause, end in failures if can_retry(cause))

        def compute_recovery_flow(body: Flow) -> Flow:
            retry_state = compute_retry_state(body)
            if retry_state is None or self.recover is None:
                return Flow(retry_state, {}, None)
            return get_flow(self.recover, retry_state)

        body, _ = find_fixed_point(get_flow, self.do, state, lambda body: compute_recovery_flow(body).success)
        recovery = compute_recovery_flow(body)
        state_after_failed_recovery = join_states(recovery.failures.values())
        failures = {
            failure: end.join(state_after_failed_recovery or end) if can_retry(failure) else end
            for failure, end in body.failures.items()
        }
        delay_state = compute_retry_state(body) if self.backoff else None
        return Flow(body.success, failures, join_states((body.halted, recovery.halted, delay_state)))

    def check(self, analysis: NodeAnalysis) -> Iterator[NodeFinding]:
        """Yield a warning if nothing changes between the attempts, or if there is only one attempt."""
        skills = analysis.list_skills().values()
        may_change = any(skill is None or skill.senses or skill.moves or skill.waits for skill in skills)
        if not self.backoff and skills and not may_change:
            message = "this retry changes nothing between its attempts: no node in it looks, moves or waits"
            hint = "Put a look or a motion into `do` or `recover`, or wait with `backoff`."
            yield NodeFinding("", "unchanging-retry", message, hint, is_warning=True)
        # A param with the value 1 is no mistake, because the param may have another value in another run.
        if self.attempts == 1 and analysis.is_written_as_constant("attempts"):
            message = "a retry with 1 attempt never runs its body again"
            yield NodeFinding("attempts", "unchanging-retry", message, is_warning=True)

    @property
    def unreachable_reason(self) -> str:
        """Reason why the recovery never runs; "" if another finding explains this."""
        # `check_failure_names` reports failures in `on` that the body cannot have.
        if self.on and self.attempts > 1:
            return ""
        return "there is only one attempt" if self.attempts == 1 else "the body never fails"

    def explain(self, failure: PropagatedFailure) -> str:
        """Return the cause: a failed recovery, a failure that `on` does not list, or no attempts left."""
        counts = Counter(failure.handled_counts)
        if failure.last_choice == _GIVE_UP:
            attempt, _ = self.count_attempts(failure)
            cause = f"{failure.last_handled_name}: {failure.last_messages[failure.last_handled_name]}"
            return f"gave up after attempt {attempt} of {self.attempts}: its recovery failed with {cause}"
        if self.on and not failure.matches(self.on):
            earlier_failures = f"; failures before: {_format_counts(counts)}" if counts else ""
            return f"runs again only after {format_reasons(self.on)}{earlier_failures}"
        counts[failure.name] += 1
        if self.attempts == 1:
            return "has no second attempt"
        return f"all {self.attempts} attempts failed: {_format_counts(counts)}"

    def count_attempts(self, failure: PropagatedFailure) -> tuple[int, int]:
        """Return the number of the failed attempt and the number of allowed attempts."""
        handled_count = sum(failure.handled_counts.values())
        if failure.last_choice == _GIVE_UP:
            # The node has handled the failures of all attempts and the failure of the recovery.
            return handled_count - 1, self.attempts
        # The node passed on the failure of the last attempt without handling it.
        return handled_count + 1, self.attempts

    def advise(self, failure: PropagatedFailure) -> Iterator[Advice]:
        """Yield the advice to handle a failure in the recovery, or to allow more attempts."""
        attempt, attempts = self.count_attempts(failure)
        if failure.last_choice == _GIVE_UP:
            yield Advice(f"handle {failure.last_handled_name} in the recovery", child=self.recover)
        elif attempt == attempts and (not self.on or failure.matches(self.on)):
            yield Advice(f"allow more than {attempts} attempt{'s' if attempts > 1 else ''}")

    def list_contingencies(self) -> Iterator[tuple[str, Child]]:
        """Yield the key `recover` and the node at this key, if the node has a recovery."""
        if self.recover is not None:
            yield "recover", self.recover

    @property
    def counterpart(self) -> Counterpart | None:
        """`RetryUntilSuccessful` of BehaviorTree.CPP; None with `on`, `recover` or `backoff`."""
        if self.on or self.recover or self.backoff:
            return None
        return Counterpart("RetryUntilSuccessful", {"num_attempts": "attempts"})


def _format_counts(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{count} x {reason}" for reason, count in counts.items())
