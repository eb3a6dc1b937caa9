"""Sequence of nodes."""

from __future__ import annotations

from py_trees.common import Status

from executive.tree.flow import Enter, Flow, FlowState, PossibleFailure, joined
from executive.tree.inspection import MinTimes
from executive.tree.keys import Child, Children, key
from executive.tree.node import ControlNode


class Sequence(ControlNode):
    """One after the other; fails with the first that fails."""

    word = "sequence"
    symbol, shape = "→", "box"

    do: Children = key(bare=True, doc="What is done.")

    def start(self) -> None:
        """Begin with the first child."""
        self._next = 0

    def step(self) -> Status:
        """Tick the current child; continue with the next in the same tick."""
        while self._next < len(self.do):
            child = self.do[self._next]
            status = self.run_child(child)
            if status is Status.RUNNING:
                return status
            if status is Status.FAILURE:
                return self.fail(self.failure_of(child))
            self._next += 1
        return Status.SUCCESS

    def flow(self, enter: Enter, state: FlowState) -> Flow:
        """Enter each child in the state after the one before it."""
        failures: dict[PossibleFailure, FlowState] = {}
        halted = None
        here: FlowState | None = state
        for child in self.do:
            if here is None:
                break
            flow = enter(child, here)
            failures.update(flow.failures)
            here, halted = flow.success, joined((halted, flow.halted))
        return Flow(here, failures, halted)

    def min_time(self, times: MinTimes) -> float:
        """Return the sum over all children."""
        return sum(map(times, self.do))

    def explain_unreachable(self, child: Child) -> str:
        """Return the cause, an earlier child."""
        del child
        return "what stands before it never succeeds"

    @property
    def first_child(self) -> Child | None:
        """The first child."""
        return self.do[0]
