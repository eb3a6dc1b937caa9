"""Control node that runs its children in order."""

from __future__ import annotations

from py_trees.common import Status

from executive.tree.counterpart import Counterpart
from executive.tree.flow import Flow, FlowFunction, FlowState, PossibleFailure, join_states
from executive.tree.inspection import MinTimeFunction
from executive.tree.keys import Child, Children, key
from executive.tree.node import ControlNode


class Sequence(ControlNode):
    """Run the children in order; fail with the first failure.

    * BehaviorTree.CPP: `Sequence`.
    * py_trees: `Sequence(memory=True)`, which may be empty.
    """

    keyword = "sequence"
    symbol, shape = "→", "box"
    counterpart = Counterpart("Sequence")

    do: Children = key(shorthand=True, doc="Nodes to run, in order.")

    def start(self) -> None:
        """Begin with the first child."""
        self._child_index = 0

    def step(self) -> Status:
        """Tick the current child; after a success, tick the next child in the same tick."""
        while self._child_index < len(self.do):
            child = self.do[self._child_index]
            status = self.tick_child(child)
            if status is Status.RUNNING:
                return status
            if status is Status.FAILURE:
                return self.fail(self.get_failure(child))
            self._child_index += 1
        return Status.SUCCESS

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the outcomes; each child starts in the state after success of the previous child."""
        failures: dict[PossibleFailure, FlowState] = {}
        halted = None
        entry: FlowState | None = state
        for child in self.do:
            if entry is None:
                break
            flow = get_flow(child, entry)
            failures.update(flow.failures)
            entry, halted = flow.success, join_states((halted, flow.halted))
        return Flow(entry, failures, halted)

    def min_time(self, get_min_time: MinTimeFunction) -> float:
        """Return the sum of the minimum times of all children [s]."""
        return sum(map(get_min_time, self.do))

    def explain_unreachable(self, child: Child) -> str:
        """Return a text that explains why `child` never runs: an earlier child cannot succeed."""
        del child
        return "an earlier child never succeeds"

    @property
    def first_child(self) -> Child | None:
        """The first child."""
        return self.do[0]
