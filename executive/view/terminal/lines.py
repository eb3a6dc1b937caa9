"""One plain line for everything that matters, for logs and pipes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TextIO

from executive.events import TimedEvent
from executive.mission.outline import outline
from executive.record.entry import OldEvent as Event
from executive.record.entry import old_event
from executive.view.items import ItemTable
from executive.view.tree.outline import skills

if TYPE_CHECKING:
    from executive.run.run import Run

_ENDS = {"SUCCESS": "done", "FAILURE": "failed", "INVALID": "halted"}


class Lines:
    """Writes a line when a skill starts or ends, a control node decides, or an item's state changes.

    How control nodes start and end is not told: it follows from their skills.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._names: dict[str, str] = {}
        self._skills: dict[str, str] = {}
        self.items = ItemTable()

    def open(self, run: Run) -> None:
        """Learn the names of the nodes; a log has no keys to want anything of the run."""
        nodes = outline(run.root)
        self._names = {node.path: node.name for node in nodes}
        self._skills = skills(nodes)

    def __call__(self, timed: TimedEvent) -> None:
        """Write the line that `event` deserves, if any."""
        event = old_event(timed)
        text = self._text(event)
        if text:
            self._stream.write(f"{event.clock:9.2f} s  {text}\n")
            self._stream.flush()

    def close(self) -> None:
        """Leave the stream as it is: every line is out already."""

    def note(self, sentence: str) -> None:
        """Write `sentence` on a line of its own."""
        self._stream.write(f"note: {sentence}\n")

    def _text(self, event: Event) -> str:
        data = event.data
        if event.kind == "run":
            return f"{data.get('mission', 'mission')} starts, seed {data.get('seed', 0)}"
        if event.kind == "resume":
            return "taken up again: what was under way begins anew"
        if event.kind == "disturbance":
            return f"disturbance: {data['what']}"
        if event.kind == "status":
            return self._transition(data)
        if event.kind == "choice":
            after = f", after {data['reason']}" if data["reason"] else ""
            return f"{self._names[data['node']]}: {data['choice']}{after}"
        if event.kind == "request":
            return "request: " + ", ".join(f"{key} {value}" for key, value in data.items())
        if event.kind == "item":
            return self._item(event)
        return ""

    def _transition(self, data: Mapping[str, Any]) -> str:
        if data["node"] not in self._skills:
            return ""
        name = self._skills[data["node"]] + (f" [{data['item']}]" if data.get("item") else "")
        if data["status"] == "RUNNING":
            return f"{name} ..."
        why = ": ".join(str(data[key]) for key in ("reason", "message") if data.get(key))
        return f"{name} {_ENDS[data['status']]}" + (f": {why}" if why else "")

    def _item(self, event: Event) -> str:
        row = self.items(event)
        if row is None:
            return ""
        where = f" in {row.bin}" if row.state == "placed" and row.bin else ""
        return f"{row.item} {row.state}{where}" + (f": {row.why}" if row.why else "")
