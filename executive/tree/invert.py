"""Control node that exchanges success and failure of its body."""

from __future__ import annotations

from py_trees.common import Status

from executive.tree.flow import Flow, FlowFunction, FlowState, PossibleFailure, join_states
from executive.tree.inspection import Counterpart
from executive.tree.keys import Child, key
from executive.tree.node import ControlNode


class Invert(ControlNode):
    """Succeed if the body fails; fail with `inverted` if the body succeeds.

    * BehaviorTree.CPP: `Inverter`.
    * py_trees: `decorators.Inverter`.
    """

    keyword = "invert"
    reasons = ("inverted",)
    symbol = "¬"
    counterpart = Counterpart("Inverter")

    do: Child = key(shorthand=True, doc="Body.")

    def step(self) -> Status:
        """Tick the body."""
        status = self.tick_child(self.do)
        if status is Status.SUCCESS:
            return self.fail_with_reason("inverted", f"{self.do.name} succeeded")
        return Status.SUCCESS if status is Status.FAILURE else status

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the possible outcomes of the body, with success and failure exchanged."""
        flow = get_flow(self.do, state)
        inverted = PossibleFailure(self.keyword, "inverted", self.path)
        failures = {} if flow.success is None else {inverted: flow.success}
        return Flow(join_states(flow.failures.values()), failures, flow.halted)
