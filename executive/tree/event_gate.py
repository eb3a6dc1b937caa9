"""Gate of the events of a node that runs again in every tick."""

from __future__ import annotations

from collections.abc import Callable

from py_trees.common import Status

from executive.events import Emit, Event
from executive.tree.keys import Child
from executive.tree.node import TreeNode

_COMPARED_ATTRIBUTES = ("node", "status", "reason", "choice", "item", "outputs")
"""Attributes of events by which two runs of a node are compared; messages may contain changing numbers."""


class EventGate:
    """Gate that discards the events of a run of a node that takes one tick and ends like the run before.

    Without a gate, a condition that is checked at every tick would fill the journal with equal events.

    Args:
        root: The node; the gate receives the events of this node and of all nodes below it.
        emit: Function that emits the events that pass the gate.
    """

    def __init__(self, root: Child, emit: Emit) -> None:
        self._root, self._emit = root, emit
        self._held_events: list[Event] | None = None
        self._last_result: list[tuple[object, ...]] | None = None
        for node in root.iterate():
            if isinstance(node, TreeNode):
                self._receive_events(node)

    def _receive_events(self, node: TreeNode) -> None:
        """Receive the events of a node, or of the outermost gate that receives them already."""
        sender: TreeNode | EventGate = node
        while isinstance(gate := getattr(sender._emit, "__self__", None), EventGate):
            sender = gate
        if sender is not self:
            sender._emit = self._handle

    def _handle(self, event: Event) -> None:
        if self._held_events is None:
            self._emit(event)
        else:
            self._held_events.append(event)

    def forget(self) -> None:
        """Forget the last result, so that the events of the next run pass."""
        self._last_result = None

    def tick(self, tick_child: Callable[[Child], Status]) -> Status:
        """Tick the node with `tick_child`, and return its status; discard its events if it ends as before."""
        if self._root.status is Status.RUNNING:
            return tick_child(self._root)
        events = self._held_events = []
        status = Status.RUNNING
        try:
            status = tick_child(self._root)
        finally:
            self._held_events = None
            result = [tuple(getattr(event, name, "") for name in _COMPARED_ATTRIBUTES) for event in events]
            if status is Status.RUNNING or result != self._last_result:
                for event in events:
                    self._emit(event)
            self._last_result = None if status is Status.RUNNING else result
        return status
