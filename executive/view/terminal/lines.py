"""Plain lines about a run, for logs and pipes."""

from __future__ import annotations

from typing import TYPE_CHECKING, TextIO

from executive import events
from executive.mission.outline import outline
from executive.record.timeline.timeline import Timeline
from executive.view.tree.outline import find_skill_names

if TYPE_CHECKING:
    from executive.run.run import Run

ENDS = {"SUCCESS": "done", "FAILURE": "failed", "INVALID": "halted"}
"""Words for the status of a node that has ended."""


class Lines:
    """Writes a line when a skill starts or ends, a control node decides, or an item's state changes.

    Starts and ends of control nodes follow from those of their skills.

    Attributes:
        timeline: Timeline of the run.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._names: dict[str, str] = {}
        self._skills: dict[str, str] = {}
        self.timeline = Timeline(history=False)

    def open(self, run: Run) -> None:
        """Read the names of the nodes."""
        nodes = outline(run.root)
        self._names = {node.path: node.name for node in nodes}
        self._skills = find_skill_names(nodes)

    def __call__(self, timed: events.TimedEvent) -> None:
        """Write the line of an event, if it has one."""
        if text := self._describe(timed.event):
            self._stream.write(f"{timed.clock:9.2f} s  {text}\n")
            self._stream.flush()
        self.timeline(timed)

    def close(self) -> None:
        """Do nothing: every line is already flushed."""

    def note(self, sentence: str) -> None:
        """Write `sentence` on a line of its own."""
        self._stream.write(f"note: {sentence}\n")

    def _describe(self, event: events.Event) -> str:
        match event:
            case events.RunStarted():
                return f"{event.mission} starts, seed {event.seed}"
            case events.RunResumed():
                return "resumed: the nodes that were running start again"
            case events.FaultInjected():
                return f"injected fault: {event.name}"
            case events.NodeStarted() if event.skill:
                return f"{self._name_skill(event)} ..."
            case events.NodeEnded() if event.skill:
                why = "".join(f": {text}" for text in (event.reason, event.message) if text)
                return f"{self._name_skill(event)} {ENDS[event.status]}{why}"
            case events.BranchChosen():
                after = f", after {event.reason}" if event.reason else ""
                return f"{self._names[event.node]}: {event.choice}{after}"
            case events.RequestGiven():
                return f"request: {event.wanted}"
            case events.ItemChanged():
                return self._describe_change(event)
        return ""

    def _name_skill(self, event: events.NodeStarted | events.NodeEnded) -> str:
        return self._skills[event.node] + (f" [{event.item}]" if event.item else "")

    def _describe_change(self, now: events.ItemChanged) -> str:
        """Return the line of a changed item; "" if only its position or its counts changed."""
        known = self.timeline.items.by_name.get(now.item)
        if known is not None and _visible_fields(known.now) == _visible_fields(now):
            return ""
        where = f" in {now.bin}" if now.state == "placed" and now.bin else ""
        return f"{now.item} {now.state}{where}" + (f": {now.why}" if now.why else "")


def _visible_fields(item: events.ItemChanged) -> tuple[str, ...]:
    return item.label, item.state, item.bin, item.why
