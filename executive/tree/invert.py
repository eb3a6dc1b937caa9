"""The other way round."""

from __future__ import annotations

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.node import ControlNode, Site


class Invert(ControlNode):
    """Succeeds where its body fails, and fails with `inverted` where it succeeds."""

    word = "invert"

    def __init__(self, site: Site, body: Behaviour) -> None:
        super().__init__(site, [body])
        self._body = body

    def step(self) -> Status:
        """Tick the body."""
        status = self.run_child(self._body)
        if status is Status.SUCCESS:
            return self.fail_for("inverted", f"{self._body.name} succeeded")
        return Status.SUCCESS if status is Status.FAILURE else status
