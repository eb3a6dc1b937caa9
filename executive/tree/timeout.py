"""Limit of the duration of a body."""

from __future__ import annotations

from collections.abc import Iterator

from py_trees.common import Status

from executive.skill import Seconds
from executive.tree.flow import Enter, Flow, FlowState, PossibleFailure
from executive.tree.inspection import Advice, MinTimes, NodeFacts, NodeFinding, PassedFailure
from executive.tree.keys import Child, key
from executive.tree.node import ControlNode

CLOCK_TOLERANCE = 0.005
"""Half a control step, by which a wait may end too early [s]."""


class Timeout(ControlNode):
    """Fails with `timeout` when its body takes longer on the run's clock.

    A body that ends in the tick in which its time is up is in time.
    """

    word = "timeout"
    reasons = ("timeout",)
    symbol = "◷"

    seconds: Seconds = key(gt=0, doc="How long it may take [s].")
    do: Child = key(doc="What is done.")

    @property
    def detail(self) -> str:
        """The limit."""
        return f"{self.seconds:g} s"

    def start(self) -> None:
        """Set the deadline."""
        self._deadline = self.clock.now + self.seconds

    def step(self) -> Status:
        """Tick the body, then compare the clock with the deadline."""
        status = self.run_child(self.do)
        if status is Status.FAILURE:
            return self.fail(self.failure_of(self.do))
        # A nanosecond of tolerance: a clock that adds up steps may miss the deadline by rounding.
        if status is Status.RUNNING and self.clock.now >= self._deadline - 1e-9:
            self.halt_children([self.do])
            return self.fail_for("timeout", f"not done after {self.seconds:g} s")
        return status

    def flow(self, enter: Enter, state: FlowState) -> Flow:
        """Add the timeout to the ends of a body that waits."""
        body = enter(self.do, state)
        failures = dict(body.failures)
        if body.halted is not None:
            failures[PossibleFailure(self.word, "timeout", self.path)] = body.halted
        return Flow(body.success, failures, body.halted)

    def min_time(self, times: MinTimes) -> float:
        """Return the time of the body."""
        return times(self.do)

    def check(self, facts: NodeFacts) -> Iterator[NodeFinding]:
        """Compare the limit with the least time of the body."""
        shortest = facts.min_time(self.do)
        if self.seconds >= shortest - CLOCK_TOLERANCE:
            return
        message = (
            f"timeout.seconds is {self.seconds:g} s, but its body takes {shortest:.2f} s at the very least"
        )
        parts = [(name, time) for name, time in facts.skill_times(self.do) if time > 0]
        hint = f"At the least: {', '.join(f'{name} {time:.2f} s' for name, time in parts)}."
        is_sum = abs(sum(time for _, time in parts) - shortest) <= 1e-9
        yield NodeFinding("seconds", "short-timeout", message, hint if is_sum else "")

    @property
    def first_child(self) -> Child | None:
        """The body."""
        return self.do

    def explain(self, failure: PassedFailure) -> str:
        """Return the duration of the body."""
        return f"limits only the time: {failure.duration:.2f} of {self.seconds:g} s had passed"

    def advise(self, failure: PassedFailure) -> Iterator[Advice]:
        """Yield a longer limit after a timeout."""
        if failure.child is None:
            yield Advice(f"allow more than {self.seconds:g} s", "seconds")
