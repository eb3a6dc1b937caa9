"""Handlers of failures, and a last step after success and failure."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

from py_trees.common import Status

from executive.tree.failure import Failure, Reason
from executive.tree.flow import Enter, Flow, FlowState, PossibleFailure, joined
from executive.tree.inspection import Advice, MinTimes, NodeFacts, NodeFinding, PassedFailure, listed
from executive.tree.keys import Child, KeySection, Reasons, key
from executive.tree.node import ControlNode


class Catch(KeySection):
    """A handler of failures."""

    on: Reasons = key(doc="The failures this is for.")
    do: Child = key(doc="What is done instead.")


class TryCatch(ControlNode):
    """A body, what to do instead when it fails, and what to do in the end either way.

    Succeeds if the body or the handler does. `finally` runs after success and failure, never after a halt or
    a fault; its own failure counts unless the node is failing already.
    """

    word = "try"
    elsewhere: ClassVar = dict.fromkeys(
        ("if", "else"), "To go another way when something fails, write try and catch."
    )
    symbol = "↯"
    one_of = ("catch", "finally")
    remedy = "put a try with a catch for it around"

    do: Child = key(bare=True, in_path=False, doc="What is done.")
    catch: tuple[Catch, ...] = key(
        partner=True, default=(), doc="A list of `on` and `do`: what to do instead after a failure."
    )
    finally_: Child | None = key(
        partner=True, default=None, doc="What is done in the end, after success or failure."
    )

    def when(self, child: Child) -> str:
        """Return the failures after which a handler runs: `on Grasp.missed`."""
        return next((f"on {listed(handler.on)}" for handler in self.catch if handler.do is child), "")

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
                # The earlier failure is the better explanation.
                return self._end_with(self._pending or failure)
            if failure is not None and current is self.do and (handler := self._handler(failure)):
                self.choose("catch", failure)
                self._current = handler
            elif self.finally_ is not None:
                self._pending = failure
                self._current = self.finally_
            else:
                return self._end_with(failure)

    def _end_with(self, failure: Failure | None) -> Status:
        return Status.SUCCESS if failure is None else self.fail(failure)

    def _handler(self, failure: Failure) -> Child | None:
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
            entry = joined(after.after_handling(failure) for failure, after in caught.items())
            if entry is None:
                continue
            for failure in caught:
                if failure.must_match(catch.on):
                    failures.pop(failure, None)
            handler = enter(catch.do, entry)
            success, halted = joined((success, handler.success)), joined((halted, handler.halted))
            failures.update(handler.failures)
        flow = Flow(success, failures, halted)
        return flow if self.finally_ is None else _finish(self.finally_, flow, enter)

    def min_time(self, times: MinTimes) -> float:
        """Return the time of the fastest of body and handlers, and of `finally`."""
        fastest = min(times(child) for child in (self.do, *(handler.do for handler in self.catch)))
        return fastest + (times(self.finally_) if self.finally_ else 0.0)

    def check(self, facts: NodeFacts) -> Iterator[NodeFinding]:
        """Find every failure in a handler that earlier ones take already, by this name or another."""
        body = facts.flow(self.do)
        earlier: list[Reason] = []
        for reason in [reason for handler in self.catch for reason in handler.on] if body else ():
            meant = [failure for failure in body.failures if failure.may_match([reason])] if body else []
            if meant and all(failure.must_match(earlier) for failure in meant):
                taker = next(e for e in earlier if meant[0].must_match([e]))
                message = f"{reason} is caught already, as {taker} in {facts.place(taker, reason)}"
                yield NodeFinding(reason, "unreachable", message, is_warning=True)
            earlier.append(reason)

    @property
    def first_child(self) -> Child | None:
        """The body."""
        return self.do

    def explain(self, failure: PassedFailure) -> str:
        """Return the failures that are caught, or the failed handler."""
        if failure.child is self.finally_:
            return "its finally failed"
        if failure.child is not self.do:
            last = failure.last
            return f"caught {last} ({failure.messages.get(last, '')}), but what it did instead failed"
        named = [reason for handler in self.catch for reason in handler.on]
        return f"catches only {listed(named)}" if named else "has no catch"

    def advise(self, failure: PassedFailure) -> Iterator[Advice]:
        """Yield a further handler for a failure of the body."""
        if failure.child is self.do:
            yield Advice("catch it in the try")

    def contingencies(self) -> Iterator[tuple[str, Child]]:
        """Yield the handlers and `finally`."""
        for handler in self.catch:
            yield f"catch on {listed(handler.on)}", handler.do
        if self.finally_ is not None:
            yield "finally", self.finally_


def _finish(last: Child, flow: Flow, enter: Enter) -> Flow:
    """Return how a node may end whose last child runs after each of the ends in `flow`."""
    success, halted = None, flow.halted
    failures: dict[PossibleFailure, FlowState] = {}
    if flow.success is not None:
        end = enter(last, flow.success)
        success, halted = end.success, joined((halted, end.halted))
        failures.update(end.failures)
    for failure, after in flow.failures.items():
        end = enter(last, after)
        halted = joined((halted, end.halted))
        failures[failure] = joined((end.success, *end.failures.values())) or after
    return Flow(success, failures, halted)
