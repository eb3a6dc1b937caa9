"""Exchange of success and failure."""

from __future__ import annotations

from py_trees.common import Status

from executive.tree.flow import Enter, Flow, FlowState, PossibleFailure, joined
from executive.tree.keys import Child, key
from executive.tree.node import ControlNode


class Invert(ControlNode):
    """Succeeds where its body fails; fails with `inverted` where it succeeds."""

    word = "invert"
    reasons = ("inverted",)
    symbol = "¬"

    do: Child = key(bare=True, doc="What is done.")

    def step(self) -> Status:
        """Tick the body."""
        status = self.run_child(self.do)
        if status is Status.SUCCESS:
            return self.fail_for("inverted", f"{self.do.name} succeeded")
        return Status.SUCCESS if status is Status.FAILURE else status

    def flow(self, enter: Enter, state: FlowState) -> Flow:
        """Exchange the ends of the body."""
        body = enter(self.do, state)
        inverted = PossibleFailure(self.word, "inverted", self.path)
        failures = {} if body.success is None else {inverted: body.success}
        return Flow(joined(body.failures.values()), failures, body.halted)
