"""Control node that tries alternatives in order."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import ClassVar

from py_trees.common import Status

from executive.tree.counterpart import Counterpart
from executive.tree.flow import Flow, FlowFunction, FlowState, PossibleFailure, join_states
from executive.tree.inspection import MinTimeFunction, PropagatedFailure
from executive.tree.keys import Child, Children, key
from executive.tree.node import ControlNode


class Fallback(ControlNode):
    """Run the children in order until a child succeeds; fail with the failure of the last child.

    The node has memory: a child that failed is not run again.

    * BehaviorTree.CPP: `Fallback`.
    * py_trees: `Selector(memory=True)`, which may be empty.
    """

    keyword = "fallback"
    keyword_hints: ClassVar = {"selector": "Write fallback."}
    symbol, shape = "?", "octagon"
    counterpart = Counterpart("Fallback")

    do: Children = key(shorthand=True, doc="Alternatives, in order.")

    def start(self) -> None:
        """Begin with the first child."""
        self._child_index = 0

    def step(self) -> Status:
        """Tick the current child; after a failure, tick the next child in the same tick."""
        while True:
            child = self.do[self._child_index]
            status = self.tick_child(child)
            if status is not Status.FAILURE:
                return status
            failure = self.get_failure(child)
            self._child_index += 1
            if self._child_index == len(self.do):
                return self.fail(failure)
            self.report_choice(f"choice {self._child_index + 1} of {len(self.do)}", failure)

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the outcomes; each child starts in the states after failures of the previous child."""
        success = halted = None
        failures: Mapping[PossibleFailure, FlowState] = {}
        entry: FlowState | None = state
        for child in self.do:
            if entry is None:
                break
            flow = get_flow(child, entry)
            success, halted = join_states((success, flow.success)), join_states((halted, flow.halted))
            failures = flow.failures
            entry = join_states(end.with_handled_failure(failure) for failure, end in failures.items())
        return Flow(success, failures, halted)

    def min_time(self, get_min_time: MinTimeFunction) -> float:
        """Return the shortest minimum time of a child [s]."""
        return min(map(get_min_time, self.do))

    def explain_unreachable(self, child: Child) -> str:
        """Return a text that explains why `child` never runs: an earlier child cannot fail."""
        del child
        return "an earlier child never fails"

    def explain(self, failure: PropagatedFailure) -> str:
        """Return the cause of a failure: all children failed. The text contains the handled failures."""
        causes = ", ".join(f"{name} ({message})" for name, message in failure.last_messages.items())
        return f"all {len(self.do)} choices failed" + (f"; the others failed with {causes}" if causes else "")

    def list_contingencies(self) -> Iterator[tuple[str, Child]]:
        """Yield all children except the first, with the names `choice 2`, `choice 3`, …."""
        for number, child in enumerate(self.do[1:], 2):
            yield f"choice {number}", child
