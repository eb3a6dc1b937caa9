"""Control node with handlers of failures, and with a child that runs after success and failure."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

from py_trees.common import Status

from executive.tree.failure import Failure, Reason
from executive.tree.flow import Flow, FlowFunction, FlowState, PossibleFailure, join_states
from executive.tree.inspection import (
    Advice,
    MinTimeFunction,
    NodeFacts,
    NodeFinding,
    PropagatedFailure,
    format_reasons,
)
from executive.tree.keys import Child, KeySection, Reasons, key
from executive.tree.node import ControlNode


class Catch(KeySection):
    """A handler of failures."""

    on: Reasons = key(doc="Failures after which the handler runs.")
    do: Child = key(doc="Node to run after such a failure.")


class TryCatch(ControlNode):
    """Run a body, a handler if the body fails, and the child `finally` at the end.

    The node succeeds if the body or the handler succeeds. `finally` runs after success and failure, but not
    after a halt or a fault. A failure of `finally` is passed on unless the body or the handler failed too.
    """

    keyword = "try"
    keyword_hints: ClassVar = dict.fromkeys(("if", "else"), "To handle a failure, write try and catch.")
    symbol = "↯"
    any_of = ("catch", "finally")
    remedy = "add a try with a catch for this failure around"

    do: Child = key(shorthand=True, in_path=False, doc="Body.")
    catch: tuple[Catch, ...] = key(
        sibling=True, default=(), doc="Handlers of failures: a list of `on` and `do`."
    )
    finally_: Child | None = key(
        sibling=True, default=None, doc="Node to run at the end, after success and failure."
    )

    def describe_trigger(self, child: Child) -> str:
        """Return a text with the failures after which a handler runs: `on Grasp.missed`."""
        return next((f"on {format_reasons(handler.on)}" for handler in self.catch if handler.do is child), "")

    def start(self) -> None:
        """Begin with the body."""
        self._current = self.do
        self._pending_failure: Failure | None = None

    def step(self) -> Status:
        """Tick the current child; continue with the next in the same tick."""
        while True:
            current = self._current
            status = self.run_child(current)
            if status is Status.RUNNING:
                return status
            failure = self.get_failure(current) if status is Status.FAILURE else None
            if current is self.finally_:
                # The failure of body or handler explains more than a failure of `finally`.
                return self._end_with(self._pending_failure or failure)
            if failure is not None and current is self.do and (handler := self._find_handler(failure)):
                self.report_choice("catch", failure)
                self._current = handler
            elif self.finally_ is not None:
                self._pending_failure = failure
                self._current = self.finally_
            else:
                return self._end_with(failure)

    def _end_with(self, failure: Failure | None) -> Status:
        return Status.SUCCESS if failure is None else self.fail(failure)

    def _find_handler(self, failure: Failure) -> Child | None:
        return next((handler.do for handler in self.catch if failure.matches(handler.on)), None)

    def compute_flow(self, flow_of: FlowFunction, state: FlowState) -> Flow:
        """Return the possible ends.

        Each handler is entered in the states after the failures that it handles, `finally` in all end states.
        """
        body = flow_of(self.do, state)
        success, halted = body.success, body.halted
        failures = dict(body.failures)
        earlier: list[Reason] = []
        for catch in self.catch:
            caught = {
                failure: after
                for failure, after in body.failures.items()
                if failure.may_match(catch.on) and not failure.must_match(earlier)
            }
            earlier += catch.on
            entry = join_states(after.after_handling(failure) for failure, after in caught.items())
            if entry is None:
                continue
            for failure in caught:
                if failure.must_match(catch.on):
                    failures.pop(failure, None)
            handler = flow_of(catch.do, entry)
            success, halted = join_states((success, handler.success)), join_states((halted, handler.halted))
            failures.update(handler.failures)
        flow = Flow(success, failures, halted)
        return flow if self.finally_ is None else _append_finally(self.finally_, flow, flow_of)

    def min_time(self, min_time_of: MinTimeFunction) -> float:
        """Return the minimum of the times of body and handlers, plus the time of `finally` [s]."""
        fastest = min(min_time_of(child) for child in (self.do, *(handler.do for handler in self.catch)))
        return fastest + (min_time_of(self.finally_) if self.finally_ else 0.0)

    def check(self, facts: NodeFacts) -> Iterator[NodeFinding]:
        """Yield a warning for every failure name of a handler whose failures earlier names catch already."""
        body = facts.get_flow(self.do)
        earlier: list[Reason] = []
        for reason in [reason for handler in self.catch for reason in handler.on] if body else ():
            matching = [failure for failure in body.failures if failure.may_match([reason])] if body else []
            if matching and all(failure.must_match(earlier) for failure in matching):
                first = next(name for name in earlier if matching[0].must_match([name]))
                message = f"{reason} is caught already, as {first} in {facts.describe_place(first, reason)}"
                yield NodeFinding(reason, "unreachable", message, is_warning=True)
            earlier.append(reason)

    @property
    def first_child(self) -> Child | None:
        """The body."""
        return self.do

    def explain(self, failure: PropagatedFailure) -> str:
        """Return a text with the failures that the node catches, or with the failed handler or `finally`."""
        if failure.child is self.finally_:
            return "the child finally failed"
        if failure.child is not self.do:
            caught = failure.last_handled
            return f"caught {caught} ({failure.last_messages.get(caught, '')}), but the handler failed"
        reasons = [reason for handler in self.catch for reason in handler.on]
        return f"catches only {format_reasons(reasons)}" if reasons else "has no catch"

    def advise(self, failure: PropagatedFailure) -> Iterator[Advice]:
        """Yield the advice to add a handler for a failure of the body."""
        if failure.child is self.do:
            yield Advice("catch this failure in the try")

    def list_contingencies(self) -> Iterator[tuple[str, Child]]:
        """Yield the handlers and `finally`, each after its name in reports."""
        for handler in self.catch:
            yield f"catch on {format_reasons(handler.on)}", handler.do
        if self.finally_ is not None:
            yield "finally", self.finally_


def _append_finally(finally_child: Child, flow: Flow, flow_of: FlowFunction) -> Flow:
    """Return the possible ends of a node whose child `finally_child` runs after each end in `flow`."""
    success, halted = None, flow.halted
    failures: dict[PossibleFailure, FlowState] = {}
    if flow.success is not None:
        end = flow_of(finally_child, flow.success)
        success, halted = end.success, join_states((halted, end.halted))
        failures.update(end.failures)
    for failure, after in flow.failures.items():
        end = flow_of(finally_child, after)
        halted = join_states((halted, end.halted))
        failures[failure] = join_states((end.success, *end.failures.values())) or after
    return Flow(success, failures, halted)
