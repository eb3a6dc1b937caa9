"""Base class of the control nodes whose decisions are written as a generator."""

from __future__ import annotations

from collections.abc import Generator
from typing import TypeAlias, cast

from py_trees.common import Status

from executive.tree.failure import Failure
from executive.tree.keys import Child
from executive.tree.node import ControlNode

NodeRun: TypeAlias = Generator[None, Status | None, Failure | None]
"""Generator that returns a failure, or None for success. A `yield` ends the tick. If a child is running, the
generator continues after the end of the child, and the value of the `yield` is the status of the child."""


class GeneratorNode(ControlNode):
    """Base class of control nodes that run one child after the other, in the order of a generator `run`.

    A subclass implements `run` in place of `start` and `step`.
    """

    def start(self) -> None:
        """Begin a new generator."""
        self._run, self._running_child = self.run(), cast("Child | None", None)

    def step(self) -> Status:
        """Tick the running child, if any; unless it is still running, continue the generator."""
        child, child_status = self._running_child, None
        if child is not None:
            child_status = self.tick_child(child)
            if child_status is Status.RUNNING:
                return child_status
            self._running_child = None
        try:
            self._run.send(child_status)
        except StopIteration as end:
            failure = cast("Failure | None", end.value)
            return Status.SUCCESS if failure is None else self.fail(failure)
        return Status.RUNNING

    def clean_up(self) -> None:
        """Close the generator, so that its `finally` blocks are executed after a halt, too."""
        self._run.close()

    def run(self) -> NodeRun:
        """Run the node from its start to its end."""
        raise NotImplementedError

    def run_child(self, child: Child) -> NodeRun:
        """Tick a child once per tick until its end, and return its failure; None after success."""
        status: Status | None = self.tick_child(child)
        if status is Status.RUNNING:
            self._running_child = child
            status = yield
        return self.get_failure(child) if status is Status.FAILURE else None
