"""Control nodes that handle failures: retry and try."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from math import inf, isfinite
from typing import cast

from executive.skill import Seconds
from executive.text.findings import Finding, make_error, make_warning
from executive.tree.flow import Flow, FlowFunction, FlowState, find_fixed_point, join_states
from executive.tree.keys import KeySection, Reasons, key
from executive.tree.loops import GeneratorBehaviour, NodeRun
from executive.tree.node import ControlNode, Counterpart, NodeAnalysis, PropagatedFailure
from executive.tree.specification import Child, Constant, Expression, Node, Reason, format_reasons

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


class Retry(ControlNode):
    """Run the body again after a failure.

    Failures that `on` does not list, and the failure of the last attempt, are passed on. Before every further
    attempt, the node waits for the delay `backoff` on the clock of the run and then runs `recover`; if
    `recover` fails, the node fails with the failure of the last attempt.

    * BehaviorTree.CPP: `RetryUntilSuccessful`; with `on`, `recover` or `backoff`, a custom node `retry`.
    * py_trees: `decorators.Retry`. Each attempt begins in a new tick, and there is no `on`, `recover` or
      `backoff`.
    """

    keyword = "retry"
    symbol = "↻"

    attempts: int = key(ge=1, accepts_expression=True, doc="Maximum number of attempts, including the first.")
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
        return f"up to {self.describe_value('attempts')} attempts, on {reasons}{backoff_text}"

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the possible outcomes, by fixed-point iteration over body and recovery."""

        def compute_recovery_flow(body: Flow) -> Flow:
            retry_state = body.join_handled(self.on) if self.attempts != 1 else None
            if retry_state is None or self.recover is None:
                return Flow(retry_state, {}, None)
            return get_flow(self.recover, retry_state)

        body, _ = find_fixed_point(get_flow, self.do, state, lambda body: compute_recovery_flow(body).success)
        recovery = compute_recovery_flow(body)
        failures = body.failures
        state_after_failed_recovery = join_states(recovery.failures.values())
        if state_after_failed_recovery is not None:
            failures = {
                failure: end.join(state_after_failed_recovery)
                if not self.on or failure.may_match(self.on)
                else end
                for failure, end in body.failures.items()
            }
        delay_state = body.join_handled(self.on) if self.backoff and self.attempts != 1 else None
        return Flow(body.success, failures, join_states((body.halted, recovery.halted, delay_state)))

    def check(self, analysis: NodeAnalysis) -> Iterator[Finding]:
        """Yield a warning if nothing changes between the attempts, or if there is only one attempt."""
        skills = analysis.list_skills(self).values()
        may_change = any(skill is None or skill.senses or skill.moves or skill.waits for skill in skills)
        if not self.backoff and skills and not may_change:
            message = "this retry changes nothing between its attempts: no node in it looks, moves or waits"
            hint = "Put a look or a motion into `do` or `recover`, or wait with `backoff`."
            yield make_warning(self.span, "unchanging-retry", message, hint)
        # A param with the value 1 is no mistake, because the param may have another value in another run.
        attempts = self.settings.get("attempts")
        if self.attempts == 1 and isinstance(attempts, Constant) and not attempts.origin:
            message = "a retry with 1 attempt never runs its body again"
            yield make_warning(attempts.span, "unchanging-retry", message)

    def explain_unreachable(self) -> str:
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
            attempts = self.describe_value("attempts")
            return f"gave up after attempt {attempt} of {attempts}: its recovery failed with {cause}"
        if self.on and not failure.matches(self.on):
            earlier_failures = f"; failures before: {_format_counts(counts)}" if counts else ""
            return f"runs again only after {format_reasons(self.on)}{earlier_failures}"
        counts[failure.name] += 1
        if self.attempts == 1:
            return "has no second attempt"
        return f"all {self.describe_value('attempts')} attempts failed: {_format_counts(counts)}"

    def count_attempts(self, failure: PropagatedFailure) -> tuple[int, int]:
        """Return the number of the failed attempt and the number of allowed attempts."""
        # The node passed on the failure of the last attempt without handling it, or it has handled the
        # failures of all attempts and the failure of the recovery.
        attempt = sum(failure.handled_counts.values()) + (-1 if failure.last_choice == _GIVE_UP else 1)
        return attempt, attempt if isinstance(self.settings.get("attempts"), Expression) else self.attempts

    def advise(self, failure: PropagatedFailure) -> Iterator[tuple[str, Node]]:
        """Yield the advice to handle a failure in the recovery, or to allow more attempts."""
        attempt, attempts = self.count_attempts(failure)
        if failure.last_choice == _GIVE_UP:
            yield f"handle {failure.last_handled_name} in the recovery", self.recover or self
        elif attempt == attempts and (not self.on or failure.matches(self.on)):
            yield f"allow more than {attempts} attempt{'s' if attempts > 1 else ''}", self

    def list_contingencies(self) -> Iterator[tuple[str, Node]]:
        """Yield the key `recover` and the node at this key, if the node has a recovery."""
        if self.recover is not None:
            yield "recover", self.recover

    @property
    def counterpart(self) -> Counterpart | None:
        """`RetryUntilSuccessful` of BehaviorTree.CPP; None with `on`, `recover` or `backoff`."""
        if self.on or self.recover or self.backoff:
            return None
        return Counterpart("RetryUntilSuccessful", {"num_attempts": "attempts"})

    class Behaviour(GeneratorBehaviour):
        """Runs the node."""

        node: Retry

        def run(self) -> NodeRun:
            """Run the body until it succeeds or no attempt is left; in between, wait and run `recover`."""
            attempt = 1
            attempts = cast("int", self.read_value("attempts"))
            while True:
                failure = yield from self.run_child(self.node.do)
                if not failure or attempt >= attempts or (self.node.on and not failure.matches(self.node.on)):
                    return failure
                delay = 0.0 if self.node.backoff is None else self.node.backoff.compute_delay(attempt)
                delay_text = f" in {delay:g} s" if delay else ""
                attempt += 1
                self.report_choice(f"attempt {attempt} of {attempts}{delay_text}", failure)
                yield from self.clock.sleep(delay)
                if self.node.recover and (recovery_failure := (yield from self.run_child(self.node.recover))):
                    self.report_choice(_GIVE_UP, recovery_failure)
                    return failure
                yield from self.end_iteration()


def _format_counts(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{count} x {reason}" for reason, count in counts.items())


class Catch(KeySection):
    """A handler: a node that runs after certain failures of the body."""

    on: Reasons = key(doc="Failures after which the handler runs.")
    do: Child = key(doc="Node to run after one of the failures in `on`.")


class TryCatch(ControlNode):
    """Run the body, a handler if the body fails, and `finally` at the end.

    The node succeeds if the body or the handler succeeds. `finally` runs after success and failure, but not
    after a halt or a fault. A failure of `finally` is passed on unless the body or the handler failed too.

    * BehaviorTree.CPP: custom node `try`. `TryCatch` has one handler for all failures, and fails after the
      handler has succeeded.
    * py_trees: no counterpart.
    """

    keyword = "try"
    symbol = "↯"
    any_of = ("catch", "finally")
    remedy = "catch this failure in a new try around"

    do: Child = key(shorthand=True, in_path=False, doc="Body.")
    catch: tuple[Catch, ...] = key(
        sibling=True, default=(), doc="Handlers of failures: a list of `on` and `do`."
    )
    finally_: Child | None = key(
        sibling=True, default=None, doc="Node to run at the end, after success and failure."
    )

    def describe_trigger(self, child: Node) -> str:
        """Return the failures after which the handler `child` runs, as a text: `on Grasp.missed`."""
        return next((f"on {format_reasons(handler.on)}" for handler in self.catch if handler.do is child), "")

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the possible outcomes.

        Each handler starts after the failures that it catches; `finally` starts after body and handlers.
        """
        body = get_flow(self.do, state)
        success = body.success
        halted = body.halted
        failures = dict(body.failures)
        earlier_reasons: list[Reason] = []
        for handler in self.catch:
            caught_ends = {
                failure: end.with_handled_failure(failure)
                for failure, end in body.failures.items()
                if failure.may_match(handler.on) and not failure.matches(earlier_reasons)
            }
            earlier_reasons += handler.on
            entry = join_states(caught_ends.values())
            if entry is None:
                continue
            for failure in caught_ends:
                if failure.matches(handler.on):
                    failures.pop(failure, None)
            flow = get_flow(handler.do, entry)
            success = join_states((success, flow.success))
            halted = join_states((halted, flow.halted))
            failures.update(flow.failures)
        flow = Flow(success, failures, halted)
        return flow if self.finally_ is None else _append_finally(self.finally_, flow, get_flow)

    def check(self, analysis: NodeAnalysis) -> Iterator[Finding]:
        """Yield a warning for each reason whose failures are all caught by earlier reasons.

        A node in `finally` that ends the mission with success is an error, because it hides failures.
        """
        for node in self.finally_.walk() if self.finally_ else ():
            if isinstance(node, ControlNode) and node.ends_mission:
                message = f"{node.path_name} in `finally` ends the mission with success also after a failure"
                yield make_error(node.span, "finish-in-finally", message, "Put it at the end of the body.")
        body = analysis.get_flow(self.do)
        failures = () if body is None else body.failures
        earlier_reasons: list[Reason] = []
        for reason in [reason for handler in self.catch for reason in handler.on]:
            caught = [failure for failure in failures if failure.may_match([reason])]
            if caught and all(failure.matches(earlier_reasons) for failure in caught):
                earlier_reason = next(name for name in earlier_reasons if caught[0].matches([name]))
                place = earlier_reason.span.describe_place(reason.span.source)
                message = f"{reason} is caught already, as {earlier_reason} in {place}"
                yield make_warning(reason.span, "unreachable", message)
            earlier_reasons.append(reason)

    @property
    def first_child(self) -> Node | None:
        """The body."""
        return self.do

    def explain(self, failure: PropagatedFailure) -> str:
        """Return the cause: no matching handler, or a failure of the handler or of `finally`."""
        if failure.child is self.finally_:
            return "finally failed"
        if failure.child is not self.do:
            name = failure.last_handled_name
            return f"caught {name} ({failure.last_messages.get(name, '')}), but the handler failed"
        reasons = [reason for handler in self.catch for reason in handler.on]
        return f"catches only {format_reasons(reasons)}" if reasons else "has no catch"

    def advise(self, failure: PropagatedFailure) -> Iterator[tuple[str, Node]]:
        """Yield the advice to add a handler for a failure of the body."""
        if failure.child is self.do:
            yield "catch this failure in the try", self

    def list_contingencies(self) -> Iterator[tuple[str, Node]]:
        """Yield the handlers with names such as `catch on Grasp.missed`, then `finally`."""
        for handler in self.catch:
            yield f"catch on {format_reasons(handler.on)}", handler.do
        if self.finally_ is not None:
            yield "finally", self.finally_

    class Behaviour(GeneratorBehaviour):
        """Runs the node."""

        node: TryCatch

        def run(self) -> NodeRun:
            """Run the body, then the handler of its failure, then `finally`."""
            failure = yield from self.run_child(self.node.do)
            if failure:
                handler = next((one.do for one in self.node.catch if failure.matches(one.on)), None)
                if handler is not None:
                    self.report_choice("catch", failure)
                    failure = yield from self.run_child(handler)
            if self.node.finally_ and (later_failure := (yield from self.run_child(self.node.finally_))):
                failure = failure or later_failure
            return failure


def _append_finally(finally_child: Node, flow: Flow, get_flow: FlowFunction) -> Flow:
    """Return the possible outcomes of a node whose `finally_child` runs after each outcome in `flow`."""
    after_success = get_flow(finally_child, flow.success) if flow.success else Flow(None, {}, None)
    failures = dict(after_success.failures)
    halted = join_states((flow.halted, after_success.halted))
    for failure, entry in flow.failures.items():
        after_failure = get_flow(finally_child, entry)
        halted = join_states((halted, after_failure.halted))
        # The node passes on `failure` after success and failure of `finally`.
        failures[failure] = join_states((after_failure.success, *after_failure.failures.values())) or entry
    return Flow(after_success.success, failures, halted)
