"""Alternatives that are tried in order."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import ClassVar

from py_trees.common import Status

from executive.tree.flow import Enter, Flow, FlowState, PossibleFailure, join_states
from executive.tree.inspection import MinTimeFunction, PropagatedFailure
from executive.tree.keys import Child, Children, key
from executive.tree.node import ControlNode


class Fallback(ControlNode):
    """Run the children in order until one succeeds; fail with the failure of the last.

    The node has memory: a child that failed is not run again.
    """

    keyword = "fallback"
    keyword_hints: ClassVar = {"selector": "It is called fallback here."}
    symbol, shape = "?", "octagon"

    do: Children = key(shorthand=True, doc="Alternatives, in order.")

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
            self.report_choice(f"choice {self._next + 1} of {len(self.do)}", failure)

    def flow(self, enter: Enter, state: FlowState) -> Flow:
        """Enter each child in the states after the failures of the one before it."""
        success = halted = None
        failures: Mapping[PossibleFailure, FlowState] = {}
        entry: FlowState | None = state
        for choice in self.do:
            if entry is None:
                break
            flow = enter(choice, entry)
            success, halted = join_states((success, flow.success)), join_states((halted, flow.halted))
            failures = flow.failures
            entry = join_states(after.after_handling(failure) for failure, after in failures.items())
        return Flow(success, failures, halted)

    def min_time(self, min_time_of: MinTimeFunction) -> float:
        """Return the time of the fastest child."""
        return min(map(min_time_of, self.do))

    def explain_unreachable(self, child: Child) -> str:
        """Return the cause, an earlier child."""
        del child
        return "an earlier child never fails"

    def explain(self, failure: PropagatedFailure) -> str:
        """Return the failures of all children."""
        others = ", ".join(f"{reason} ({message})" for reason, message in failure.messages.items())
        return f"all {len(self.do)} choices failed" + (f"; the others with {others}" if others else "")

    def contingencies(self) -> Iterator[tuple[str, Child]]:
        """Yield every child but the first."""
        for number, choice in enumerate(self.do[1:], 2):
            yield f"choice {number}", choice
