"""View of a run as plain lines of text, for logs and pipes."""

from __future__ import annotations

from typing import TextIO

from executive import events
from executive.mission.outline import make_outline
from executive.record.timeline import STATUS_TEXTS, Timeline
from executive.run.run import Run
from executive.view.tree.tree_text import find_skill_names


class LineView:
    """Writes a line when a skill starts or ends, a control node decides, or the state of an item changes.

    Starts and ends of control nodes follow from the lines about their skills, and are not written.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._names_by_path: dict[str, str] = {}
        self._skill_names_by_path: dict[str, str] = {}
        self.timeline = Timeline(has_history=False)

    def open(self, run: Run) -> None:
        """Store the names of the nodes of a run."""
        nodes = make_outline(run.root)
        self._names_by_path = {node.path: node.name for node in nodes}
        self._skill_names_by_path = find_skill_names(nodes)

    def __call__(self, timed: events.TimedEvent) -> None:
        """Write a line about an event if `_describe_event` returns a text."""
        if text := self._describe_event(timed.event):
            self._stream.write(f"{timed.clock:9.2f} s  {text}\n")
            self._stream.flush()
        self.timeline(timed)

    def close(self) -> None:
        """Do nothing: every line is already flushed."""

    def show_message(self, message: str) -> None:
        """Write a message about the record of the run on a separate line."""
        self._stream.write(f"note: {message}\n")

    def _describe_event(self, event: events.Event) -> str:
        """Return the text about an event; "" for events that this view does not show."""
        match event:
            case events.RunStarted():
                return f"{event.mission} starts, seed {event.seed}"
            case events.RunResumed():
                return "resumed: the nodes that were running start again"
            case events.FaultInjected():
                return f"injected fault: {event.name}"
            case events.NodeStarted() if event.skill:
                return f"{self._describe_skill(event)} ..."
            case events.NodeEnded() if event.skill:
                details = "".join(f": {text}" for text in (event.reason, event.message) if text)
                return f"{self._describe_skill(event)} {STATUS_TEXTS[event.status]}{details}"
            case events.BranchChosen():
                reason_text = f", after {event.reason}" if event.reason else ""
                return f"{self._names_by_path[event.node]}: {event.choice}{reason_text}"
            case events.RequestGiven():
                return f"request: {event.request}"
            case events.ItemChanged():
                return self._describe_change(event)
        return ""

    def _describe_skill(self, event: events.NodeStarted | events.NodeEnded) -> str:
        """Return the name of the skill of an event, with the item of the event."""
        return self._skill_names_by_path[event.node] + (f" [{event.item}]" if event.item else "")

    def _describe_change(self, change: events.ItemChanged) -> str:
        """Return the text about a changed item; "" if only its position or its counts changed."""
        item = self.timeline.items.by_name.get(change.item)
        if item is not None and _get_described_fields(item.last_change) == _get_described_fields(change):
            return ""
        bin_text = f" in {change.bin}" if change.state == "placed" and change.bin else ""
        return f"{change.item} {change.state}{bin_text}" + (f": {change.reason}" if change.reason else "")


def _get_described_fields(change: events.ItemChanged) -> tuple[str, ...]:
    return change.label, change.state, change.bin, change.reason
