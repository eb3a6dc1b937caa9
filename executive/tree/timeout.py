"""Control node that limits the time of its body."""

from __future__ import annotations

from collections.abc import Iterator

from py_trees.common import Status

from executive.skill import Seconds
from executive.tree.flow import Flow, FlowFunction, FlowState, PossibleFailure
from executive.tree.inspection import Advice, Counterpart, PropagatedFailure
from executive.tree.keys import Child, key
from executive.tree.node import ControlNode


class Timeout(ControlNode):
    """Fail with the reason `timeout` if the body takes longer than a limit on the clock of the run.

    A body that ends in the same tick in which the clock reaches the limit is in time.

    * BehaviorTree.CPP: `Timeout`. A timer thread halts the body when the wall clock reaches the limit, and
      the node fails in the next tick.
    * py_trees: `decorators.Timeout`, with the limit on the wall clock.
    """

    keyword = "timeout"
    reasons = ("timeout",)
    symbol = "◷"

    seconds: Seconds = key(gt=0, doc="Maximum duration of the body [s].")
    do: Child = key(doc="Body.")

    @property
    def detail(self) -> str:
        """The limit as a text: `5 s`."""
        return f"{self.seconds:g} s"

    def start(self) -> None:
        """Set the deadline."""
        self._deadline = self.clock.now + self.seconds

    def step(self) -> Status:
        """Tick the body, then compare the clock with the deadline."""
        status = self.tick_child(self.do)
        if status is Status.FAILURE:
            return self.fail(self.get_failure(self.do))
        # 1 ns covers the rounding errors of a clock that sums control periods.
        if status is Status.RUNNING and self.clock.now >= self._deadline - 1e-9:
            self.halt_children([self.do])
            return self.fail_with_reason("timeout", f"the body did not end within {self.seconds:g} s")
        return status

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the outcomes of the body, and the timeout if the body can take more than one tick."""
        flow = get_flow(self.do, state)
        failures = dict(flow.failures)
        if flow.halted is not None:
            failures[PossibleFailure(self.keyword, "timeout", self.path)] = flow.halted
        return Flow(flow.success, failures, flow.halted)

    @property
    def first_child(self) -> Child | None:
        """The body."""
        return self.do

    def explain(self, failure: PropagatedFailure) -> str:
        """Return the duration of the body and the limit."""
        return f"handles no failures; {failure.duration:.2f} of {self.seconds:g} s had passed"

    def advise(self, failure: PropagatedFailure) -> Iterator[Advice]:
        """Yield the advice to increase the limit after a timeout."""
        if failure.child is None:
            yield Advice(f"allow more than {self.seconds:g} s", "seconds")

    @property
    def counterpart(self) -> Counterpart | None:
        """`Timeout` of BehaviorTree.CPP, with the limit in whole milliseconds."""
        # A limit that is unknown during the export is infinite here.
        return Counterpart("Timeout", {"msec": max(1, round(1000 * min(self.seconds, 1e6)))})
