"""Control node with handlers of failures and a final child."""

from __future__ import annotations

from collections.abc import Iterator

from executive.tree.failure import Failure, Reason, format_reasons
from executive.tree.flow import Flow, FlowFunction, FlowState, join_states
from executive.tree.inspection import Advice, NodeAnalysis, NodeFinding, PropagatedFailure
from executive.tree.keys import Child, KeySection, Reasons, key
from executive.tree.loops import GeneratorNode, NodeRun


class Catch(KeySection):
    """A handler: a node that runs after certain failures of the body."""

    on: Reasons = key(doc="Failures after which the handler runs.")
    do: Child = key(doc="Node to run after one of the failures in `on`.")


class TryCatch(GeneratorNode):
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

    def describe_trigger(self, child: Child) -> str:
        """Return the failures after which the handler `child` runs, as a text: `on Grasp.missed`."""
        return next((f"on {format_reasons(handler.on)}" for handler in self.catch if handler.do is child), "")

    def run(self) -> NodeRun:
        """Run the body, then the handler of its failure, then `finally`."""
        failure = yield from self.run_child(self.do)
        if failure and (handler := self._find_handler(failure)):
            self.report_choice("catch", failure)
            failure = yield from self.run_child(handler)
        failure_of_finally = (yield from self.run_child(self.finally_)) if self.finally_ else None
        return failure or failure_of_finally

    def _find_handler(self, failure: Failure) -> Child | None:
        return next((handler.do for handler in self.catch if failure.matches(handler.on)), None)

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the possible outcomes.

        Each handler starts after the failures that it catches; `finally` starts after body and handlers.
        """
        body = get_flow(self.do, state)
        success, halted, failures = body.success, body.halted, dict(body.failures)
        earlier_reasons: list[Reason] = []
        for handler in self.catch:
            caught_ends = {
                failure: end.with_handled_failure(failure)
                for failure, end in body.failures.items()
                if failure.may_match(handler.on) and not failure.must_match(earlier_reasons)
            }
            earlier_reasons += handler.on
            entry = join_states(caught_ends.values())
            if entry is None:
                continue
            for failure in caught_ends:
                if failure.must_match(handler.on):
                    failures.pop(failure, None)
            flow = get_flow(handler.do, entry)
            success, halted = join_states((success, flow.success)), join_states((halted, flow.halted))
            failures.update(flow.failures)
        flow = Flow(success, failures, halted)
        return flow if self.finally_ is None else _append_finally(self.finally_, flow, get_flow)

    def check(self, analysis: NodeAnalysis) -> Iterator[NodeFinding]:
        """Yield a warning for each reason whose failures are all caught by earlier reasons."""
        body = analysis.get_flow(self.do)
        failures = () if body is None else body.failures
        earlier_reasons: list[Reason] = []
        for reason in [reason for handler in self.catch for reason in handler.on]:
            caught = [failure for failure in failures if failure.may_match([reason])]
            if caught and all(failure.must_match(earlier_reasons) for failure in caught):
                earlier_reason = next(name for name in earlier_reasons if caught[0].must_match([name]))
                place = analysis.describe_place(earlier_reason, reason)
                message = f"{reason} is caught already, as {earlier_reason} in {place}"
                yield NodeFinding(reason, "unreachable", message, is_warning=True)
            earlier_reasons.append(reason)

    @property
    def first_child(self) -> Child | None:
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

    def advise(self, failure: PropagatedFailure) -> Iterator[Advice]:
        """Yield the advice to add a handler for a failure of the body."""
        if failure.child is self.do:
            yield Advice("catch this failure in the try")

    def list_contingencies(self) -> Iterator[tuple[str, Child]]:
        """Yield the handlers with names such as `catch on Grasp.missed`, then `finally`."""
        for handler in self.catch:
            yield f"catch on {format_reasons(handler.on)}", handler.do
        if self.finally_ is not None:
            yield "finally", self.finally_


def _append_finally(finally_child: Child, flow: Flow, get_flow: FlowFunction) -> Flow:
    """Return the possible outcomes of a node whose `finally_child` runs after each outcome in `flow`."""
    after_success = get_flow(finally_child, flow.success) if flow.success else Flow(None, {}, None)
    failures, halted = dict(after_success.failures), join_states((flow.halted, after_success.halted))
    for failure, entry in flow.failures.items():
        after_failure = get_flow(finally_child, entry)
        halted = join_states((halted, after_failure.halted))
        # The node passes on `failure` after success and failure of `finally`.
        failures[failure] = join_states((after_failure.success, *after_failure.failures.values())) or entry
    return Flow(after_success.success, failures, halted)
