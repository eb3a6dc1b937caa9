"""Time limit of a body."""

from __future__ import annotations

from collections.abc import Iterator

from py_trees.common import Status

from executive.skill import Seconds
from executive.tree.flow import Enter, Flow, FlowState, PossibleFailure
from executive.tree.inspection import Advice, MinTimeFunction, NodeFacts, NodeFinding, PropagatedFailure
from executive.tree.keys import Child, key
from executive.tree.node import ControlNode

CLOCK_TOLERANCE = 0.005
"""Largest time by which a wait may end too early, half a control step [s]."""


class Timeout(ControlNode):
    """Fail with `timeout` if the body takes longer than a limit on the clock of the run.

    A body that ends in the tick in which the limit is reached is in time.
    """

    keyword = "timeout"
    reasons = ("timeout",)
    symbol = "◷"

    seconds: Seconds = key(gt=0, doc="Maximum duration of the body [s].")
    do: Child = key(doc="Body.")

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
        # The tolerance of 1 ns covers rounding of a clock that sums control steps.
        if status is Status.RUNNING and self.clock.now >= self._deadline - 1e-9:
            self.halt_children([self.do])
            return self.fail_for("timeout", f"the body was not done after {self.seconds:g} s")
        return status

    def flow(self, enter: Enter, state: FlowState) -> Flow:
        """Add the timeout to the ends of a body that waits."""
        body = enter(self.do, state)
        failures = dict(body.failures)
        if body.halted is not None:
            failures[PossibleFailure(self.keyword, "timeout", self.path)] = body.halted
        return Flow(body.success, failures, body.halted)

    def min_time(self, min_time_of: MinTimeFunction) -> float:
        """Return the minimum time of the body [s]."""
        return min_time_of(self.do)

    def check(self, facts: NodeFacts) -> Iterator[NodeFinding]:
        """Compare the limit with the minimum time of the body."""
        shortest = facts.min_time(self.do)
        if self.seconds >= shortest - CLOCK_TOLERANCE:
            return
        message = f"timeout.seconds is {self.seconds:g} s, but its body takes at least {shortest:.2f} s"
        skill_times = [(name, time) for name, time in facts.skill_times(self.do) if time > 0]
        hint = f"Minimum times: {', '.join(f'{name} {time:.2f} s' for name, time in skill_times)}."
        is_sum = abs(sum(time for _, time in skill_times) - shortest) <= 1e-9
        yield NodeFinding("seconds", "short-timeout", message, hint if is_sum else "")

    @property
    def first_child(self) -> Child | None:
        """The body."""
        return self.do

    def explain(self, failure: PropagatedFailure) -> str:
        """Return the duration of the body."""
        return f"limits only the time: {failure.duration:.2f} of {self.seconds:g} s had passed"

    def advise(self, failure: PropagatedFailure) -> Iterator[Advice]:
        """Yield a longer limit after a timeout."""
        if failure.child is None:
            yield Advice(f"allow more than {self.seconds:g} s", "seconds")
