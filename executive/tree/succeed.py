"""In any case."""

from __future__ import annotations

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.node import ControlNode, Site


class Succeed(ControlNode):
    """Succeeds however its body ends; without a body, at once."""

    word = "succeed"

    def __init__(self, site: Site, body: Behaviour | None = None) -> None:
        super().__init__(site, [] if body is None else [body])

    def step(self) -> Status:
        """Tick the body, if any."""
        for body in self.children:
            status = self.run_child(body)
            if status is Status.FAILURE:
                self.choose("succeed none the less", self.failure_of(body))
            elif status is Status.RUNNING:
                return status
        return Status.SUCCESS
