"""Success in any case."""

from __future__ import annotations

from py_trees.common import Status

from executive.tree.flow import Enter, Flow, FlowState, joined
from executive.tree.keys import Child, key
from executive.tree.node import ControlNode


class Succeed(ControlNode):
    """Succeeds however its body ends; without a body at once."""

    word = "succeed"
    symbol = "✓"

    do: Child | None = key(bare=True, default=None, doc="What is done.")

    def step(self) -> Status:
        """Tick the body, if any."""
        if self.do is None:
            return Status.SUCCESS
        status = self.run_child(self.do)
        if status is Status.FAILURE:
            self.choose("succeed none the less", self.failure_of(self.do))
        return Status.RUNNING if status is Status.RUNNING else Status.SUCCESS

    def flow(self, enter: Enter, state: FlowState) -> Flow:
        """Join all ends of the body."""
        if self.do is None:
            return Flow(state, {}, None)
        body = enter(self.do, state)
        return Flow(joined((body.success, *body.failures.values())), {}, body.halted)
