"""Alternatives that are tried in order."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import ClassVar

from py_trees.common import Status

from executive.tree.flow import Enter, Flow, FlowState, PossibleFailure, joined
from executive.tree.inspection import MinTimes, PassedFailure
from executive.tree.keys import Child, Children, key
from executive.tree.node import ControlNode


class Fallback(ControlNode):
    """One after the other until one succeeds; fails with the failure of the last.

    It has memory: a child that failed is not run again.
    """

    word = "fallback"
    elsewhere: ClassVar = {"selector": "It is called fallback here."}
    symbol, shape = "?", "octagon"

    do: Children = key(bare=True, doc="What is tried.")

    def start(self) -> None:
        """Begin with the first child."""
        self._next = 0

    def step(self) -> Status:
        """Tick the current child; continue with the next in the same tick."""
        while True:
            child = self.do[self._next]
            status = self.run_child(child)
            if status is not Status.FAILURE:
                return status
            failure = self.failure_of(child)
            self._next += 1
            if self._next == len(self.do):
                return self.fail(failure)
            self.choose(f"choice {self._next + 1} of {len(self.do)}", failure)

    def flow(self, enter: Enter, state: FlowState) -> Flow:
        """Enter each child in the states after the failures of the one before it."""
        success = halted = None
        failures: Mapping[PossibleFailure, FlowState] = {}
        here: FlowState | None = state
        for choice in self.do:
            if here is None:
                break
            flow = enter(choice, here)
            success, halted = joined((success, flow.success)), joined((halted, flow.halted))
            failures = flow.failures
            here = joined(after.after_handling(failure) for failure, after in failures.items())
        return Flow(success, failures, halted)

    def min_time(self, times: MinTimes) -> float:
        """Return the time of the fastest child."""
        return min(map(times, self.do))

    def explain_unreachable(self, child: Child) -> str:
        """Return the cause, an earlier child."""
        del child
        return "what stands before it never fails"

    def explain(self, failure: PassedFailure) -> str:
        """Return the failures of all children."""
        others = ", ".join(f"{reason} ({said})" for reason, said in failure.messages.items())
        return f"all {len(self.do)} choices failed" + (f"; the others with {others}" if others else "")

    def contingencies(self) -> Iterator[tuple[str, Child]]:
        """Yield every child but the first."""
        for number, choice in enumerate(self.do[1:], 2):
            yield f"choice {number}", choice
