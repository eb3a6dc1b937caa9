"""Base class of the control nodes whose decisions are written as a generator."""

from __future__ import annotations

from collections.abc import Generator
from typing import TypeAlias, cast

from py_trees.common import Status

from executive.tree.failure import Failure
from executive.tree.keys import Child
from executive.tree.node import ControlNode

NodeRun: TypeAlias = Generator[None, None, Failure | None]
"""Generator that yields once per tick, and returns a failure, or None for success."""


class GeneratorNode(ControlNode):
    """Base class of control nodes that run one child after the other, in the order of a generator `run`.

    A subclass implements `run` in place of `start` and `step`.
    """

    def start(self) -> None:
        """Begin a new generator."""
        self._run = self.run()

    def step(self) -> Status:
        """Continue the generator until the end of the tick, and return the status."""
        try:
            next(self._run)
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
        while (status := self.tick_child(child)) is Status.RUNNING:
            yield
        return self.get_failure(child) if status is Status.FAILURE else None
