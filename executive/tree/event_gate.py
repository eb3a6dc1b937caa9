"""Gate of the events of a node that runs again in every tick."""

from __future__ import annotations

from collections.abc import Callable

from py_trees.common import Status

from executive.events import Emit, Event
from executive.tree.keys import Child

_COMPARED_ATTRIBUTES = ("node", "status", "reason", "choice", "item", "outputs")
"""Attributes of events by which two runs of a node are compared; messages may contain changing numbers."""


class EventGate:
    """Gate that discards the events of a run of a node that takes one tick and ends like the run before.

    Without a gate, a condition that is checked at every tick would fill the journal with equal events.

    Args:
        node: The node; the gate receives the events of this node and of all nodes below it.
        tick_child: Function that ticks the node and returns its status.
        emit: Function that emits the events that pass the gate.
    """

    def __init__(self, node: Child, tick_child: Callable[[Child], Status], emit: Emit) -> None:
        self._node, self._tick_child, self._emit = node, tick_child, emit
        self._held_events: list[Event] | None = None
        self._last_result: list[tuple[object, ...]] | None = None

    def hold(self, event: Event) -> bool:
        """Hold an event until the end of the first tick of a run; return False if the gate is open."""
        if self._held_events is None:
            return False
        self._held_events.append(event)
        return True

    def forget(self) -> None:
        """Forget the last result, so that the events of the next run pass."""
        self._last_result = None

    def tick(self) -> Status:
        """Tick the node, and return its status; discard its events if it ends as before."""
        if self._node.status is Status.RUNNING:
            return self._tick_child(self._node)
        events = self._held_events = []
        status = Status.RUNNING
        try:
            status = self._tick_child(self._node)
        finally:
            self._held_events = None
            result = [tuple(getattr(event, name, "") for name in _COMPARED_ATTRIBUTES) for event in events]
            if status is Status.RUNNING or result != self._last_result:
                for event in events:
                    self._emit(event)
            self._last_result = None if status is Status.RUNNING else result
        return status
