"""Control node that succeeds after any end of its body."""

from __future__ import annotations

from py_trees.common import Status

from executive.tree.flow import Flow, FlowFunction, FlowState, join_states
from executive.tree.inspection import Counterpart
from executive.tree.keys import Child, key
from executive.tree.node import ControlNode


class Succeed(ControlNode):
    """Succeed after success and failure of the body; without a body, succeed at once.

    * BehaviorTree.CPP: `ForceSuccess`; without a body, `AlwaysSuccess`.
    * py_trees: `decorators.FailureIsSuccess`; without a body, `behaviours.Success`.
    """

    keyword = "succeed"
    symbol = "✓"

    do: Child | None = key(shorthand=True, default=None, doc="Body.")

    def step(self) -> Status:
        """Tick the body, if any."""
        if self.do is None:
            return Status.SUCCESS
        status = self.tick_child(self.do)
        if status is Status.FAILURE:
            self.report_choice("succeed despite the failure", self.get_failure(self.do))
        return Status.RUNNING if status is Status.RUNNING else Status.SUCCESS

    def compute_flow(self, get_flow: FlowFunction, state: FlowState) -> Flow:
        """Return the possible outcomes: success after success and failure of the body, or a halt."""
        if self.do is None:
            return Flow(state, {}, None)
        flow = get_flow(self.do, state)
        return Flow(join_states((flow.success, *flow.failures.values())), {}, flow.halted)

    @property
    def counterpart(self) -> Counterpart | None:
        """`ForceSuccess` of BehaviorTree.CPP; without a body, `AlwaysSuccess`."""
        return Counterpart("ForceSuccess" if self.do else "AlwaysSuccess")
