"""Base class of the control nodes that run children again in every tick."""

from __future__ import annotations

from py_trees.common import Status

from executive.events import Event
from executive.tree.keys import Child
from executive.tree.node import ControlNode
from executive.tree.tree_node import NodeContext

_COMPARED_ATTRIBUTES = ("node", "status", "reason", "choice", "item", "outputs")
"""Attributes of events by which two runs of a child are compared; the numbers in messages may differ."""


class ReactiveNode(ControlNode):
    """Base class of the control nodes that run children again in every tick.

    If a run of a child takes one tick and has the same result as the previous run, its events are discarded.
    Without this rule, a condition that is checked at every tick would fill the journal with equal events.
    """

    def __init__(self, context: NodeContext, **values: object) -> None:
        super().__init__(context, **values)
        self._held_events: list[Event] | None = None
        """Events of the child that `tick_again` ticks; None outside of `tick_again`."""
        self._last_results: dict[Child, list[tuple[object, ...]]] = {}

    def start(self) -> None:
        """Forget all previous results, so that the first run of each child emits events."""
        self._last_results = {}

    def emit(self, event: Event) -> None:
        """Emit an event of this node or of a node below; hold the events of a child that runs again."""
        if self._held_events is None:
            super().emit(event)
        else:
            self._held_events.append(event)

    def tick_again(self, child: Child) -> Status:
        """Tick a child, and return its status; discard its events if it ends as in its previous run."""
        if child.status is Status.RUNNING:
            return self.tick_child(child)
        events = self._held_events = []
        status = Status.RUNNING
        try:
            status = self.tick_child(child)
        finally:
            self._held_events = None
            result = [tuple(getattr(event, name, "") for name in _COMPARED_ATTRIBUTES) for event in events]
            if status is Status.RUNNING or result != self._last_results.get(child):
                for event in events:
                    self.emit(event)
            self._last_results[child] = [] if status is Status.RUNNING else result
        return status
