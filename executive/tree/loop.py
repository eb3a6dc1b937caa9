"""Base class of loops."""

from __future__ import annotations

from py_trees.common import Status

from executive.tree.generator_node import GeneratorNode, NodeRun


class Loop(GeneratorNode):
    """Base class of loops, which determines when the next iteration begins.

    After an iteration that took only one tick, the next iteration begins in the next tick, so that a loop
    never blocks a tick. After a longer iteration, the next iteration begins in the same tick.
    """

    symbol = "↻"

    def start(self) -> None:
        """Begin the first iteration."""
        super().start()
        self._has_tick_passed = False

    def step(self) -> Status:
        """Continue by one tick."""
        status = super().step()
        self._has_tick_passed = True
        return status

    def end_iteration(self) -> NodeRun:
        """End an iteration; wait for the next tick if the iteration took only one tick."""
        if not self._has_tick_passed:
            yield
        self._has_tick_passed = False
        return None
