"""Handlers of failures, and a node that runs after success and failure."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

from py_trees.common import Status

from executive.tree.failure import Failure, Reason
from executive.tree.flow import Enter, Flow, FlowState, PossibleFailure, join_states
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
    do: Child = key(doc="Node to run instead.")


class TryCatch(ControlNode):
    """Run a body, a handler if the body fails, and `finally` at the end.

    The node succeeds if the body or the handler succeeds. `finally` runs after success and failure, never
    after a halt or a fault; a failure of `finally` is passed on unless the node is failing already.
    """

    keyword = "try"
    keyword_hints: ClassVar = dict.fromkeys(("if", "else"), "To handle a failure, write try and catch.")
    symbol = "↯"
    any_of = ("catch", "finally")
    remedy = "put a try with a catch for it around"

    do: Child = key(shorthand=True, in_path=False, doc="Body.")
    catch: tuple[Catch, ...] = key(
        sibling=True, default=(), doc="Handlers of failures: a list of `on` and `do`."
    )
    finally_: Child | None = key(
        sibling=True, default=None, doc="Node to run at the end, after success and failure."
    )

    def describe_trigger(self, child: Child) -> str:
        """Return the failures after which a handler runs: `on Grasp.missed`."""
        return next((f"on {format_reasons(handler.on)}" for handler in self.catch if handler.do is child), "")

    def start(self) -> None:
        """Begin with the body."""
        self._current = self.do
        self._pending: Failure | None = None

    def step(self) -> Status:
        """Tick the current child; continue with the next in the same tick."""
        while True:
            current = self._current
            status = self.run_child(current)
            if status is Status.RUNNING:
                return status
            failure = self.failure_of(current) if status is Status.FAILURE else None
            if current is self.finally_:
                # The failure of body or handler explains more than a failure of `finally`.
                return self._end_with(self._pending or failure)
            if failure is not None and current is self.do and (handler := self._find_handler(failure)):
                self.report_choice("catch", failure)
                self._current = handler
            elif self.finally_ is not None:
                self._pending = failure
                self._current = self.finally_
            else:
                return self._end_with(failure)

    def _end_with(self, failure: Failure | None) -> Status:
        return Status.SUCCESS if failure is None else self.fail(failure)

    def _find_handler(self, failure: Failure) -> Child | None:
        return next((handler.do for handler in self.catch if failure.matches(handler.on)), None)

    def flow(self, enter: Enter, state: FlowState) -> Flow:
        """Enter each handler in the states after its failures, and `finally` in all states at the end."""
        body = enter(self.do, state)
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
            handler = enter(catch.do, entry)
            success, halted = join_states((success, handler.success)), join_states((halted, handler.halted))
            failures.update(handler.failures)
        flow = Flow(success, failures, halted)
        return flow if self.finally_ is None else _append(self.finally_, flow, enter)

    def min_time(self, min_time_of: MinTimeFunction) -> float:
        """Return the minimum time of the fastest of body and handlers, plus that of `finally` [s]."""
        fastest = min(min_time_of(child) for child in (self.do, *(handler.do for handler in self.catch)))
        return fastest + (min_time_of(self.finally_) if self.finally_ else 0.0)

    def check(self, facts: NodeFacts) -> Iterator[NodeFinding]:
        """Find every failure name in a handler whose failures are caught by earlier names."""
        body = facts.flow(self.do)
        earlier: list[Reason] = []
        for reason in [reason for handler in self.catch for reason in handler.on] if body else ():
            meant = [failure for failure in body.failures if failure.may_match([reason])] if body else []
            if meant and all(failure.must_match(earlier) for failure in meant):
                catcher = next(e for e in earlier if meant[0].must_match([e]))
                message = f"{reason} is caught already, as {catcher} in {facts.place(catcher, reason)}"
                yield NodeFinding(reason, "unreachable", message, is_warning=True)
            earlier.append(reason)

    @property
    def first_child(self) -> Child | None:
        """The body."""
        return self.do

    def explain(self, failure: PropagatedFailure) -> str:
        """Return the failures that are caught, or the failed handler."""
        if failure.child is self.finally_:
            return "its finally failed"
        if failure.child is not self.do:
            last = failure.last
            return f"caught {last} ({failure.messages.get(last, '')}), but the handler failed"
        named = [reason for handler in self.catch for reason in handler.on]
        return f"catches only {format_reasons(named)}" if named else "has no catch"

    def advise(self, failure: PropagatedFailure) -> Iterator[Advice]:
        """Yield a further handler for a failure of the body."""
        if failure.child is self.do:
            yield Advice("catch it in the try")

    def contingencies(self) -> Iterator[tuple[str, Child]]:
        """Yield the handlers and `finally`."""
        for handler in self.catch:
            yield f"catch on {format_reasons(handler.on)}", handler.do
        if self.finally_ is not None:
            yield "finally", self.finally_


def _append(last: Child, flow: Flow, enter: Enter) -> Flow:
    """Return how a node may end whose child `last` runs after each end in `flow`."""
    success, halted = None, flow.halted
    failures: dict[PossibleFailure, FlowState] = {}
    if flow.success is not None:
        end = enter(last, flow.success)
        success, halted = end.success, join_states((halted, end.halted))
        failures.update(end.failures)
    for failure, after in flow.failures.items():
        end = enter(last, after)
        halted = join_states((halted, end.halted))
        failures[failure] = join_states((end.success, *end.failures.values())) or after
    return Flow(success, failures, halted)
