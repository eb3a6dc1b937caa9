"""Live view in a terminal: the tree with its running path, the items, and the clock."""

from __future__ import annotations

import threading
from collections.abc import Sequence

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from executive.errors import escape_control_characters
from executive.events import TimedEvent
from executive.mission.outline import OutlineNode, outline
from executive.record.entry import old_event
from executive.run.run import Run
from executive.run.run_control import RunControl
from executive.view.items import ItemTable
from executive.view.terminal.keys import HELP, HELP_PAUSED, Keys
from executive.view.tree.outline import branches, opened

REDRAWS_PER_SECOND = 10
"""Frequency at which the view is drawn [1/s]."""

_MARKS = {
    "RUNNING": ("▶", "bold yellow"),
    "SUCCESS": ("✓", "green"),
    "FAILURE": ("✗", "red"),
    "INVALID": ("·", "dim"),
}
_STATES = {"placed": "green", "rejected": "red", "lost": "red", "held": "yellow", "dropped": "yellow"}


class Terminal:
    """Redraws ten times a second, from a thread of its own.

    The tick thread only notes what happened, so a slow terminal cannot slow the run down.

    Args:
        console: The terminal.
        keyboard: File descriptor of the terminal's keyboard; None: keys do nothing.
    """

    def __init__(self, console: Console, keyboard: int | None = None) -> None:
        self._console = console
        self._keyboard = keyboard
        self._control: RunControl | None = None
        self._keys: Keys | None = None
        self._outline: Sequence[OutlineNode] = ()
        self._status: dict[str, str] = {}
        self._why: dict[str, str] = {}
        self._header = ""
        self._clock = 0.0
        self._lock = threading.Lock()
        self.items = ItemTable()
        self._live = Live(
            console=console, get_renderable=self.render, refresh_per_second=REDRAWS_PER_SECOND, transient=True
        )

    def open(self, run: Run) -> None:
        """Draw the tree and begin to follow the run, and to hand on what keys want of it."""
        self._outline = outline(run.root)
        self._control = run.control
        if self._keyboard is not None:
            self._keys = Keys(self._keyboard, run.control)
        self._show(True)

    def __call__(self, timed: TimedEvent) -> None:
        """Show an event; step aside while the operator is asked something."""
        event = old_event(timed)
        if event.kind in ("asking", "request"):
            self._show(event.kind == "request")
        data = event.data
        with self._lock:
            self._clock = event.clock
            if event.kind == "run":
                self._header = f"{data.get('mission', '')}  seed {data.get('seed', 0)}"
            elif event.kind == "status":
                node = str(data.get("node", ""))
                self._status[node] = str(data.get("status", ""))
                why = str(data.get("reason") or data.get("item") or "")
                self._why[node] = escape_control_characters(why)
            elif event.kind == "item":
                self.items(event)

    def close(self) -> None:
        """Take the view away; what remains to be said is the summary's."""
        self._show(False)

    def note(self, sentence: str) -> None:
        """Write `sentence` on a line of its own."""
        text = escape_control_characters(sentence)
        self._console.print(Text(f"note: {text}", style="yellow"))

    def render(self) -> RenderableType:
        """Return the view of this moment."""
        with self._lock:
            page = Table.grid(padding=(0, 4))
            page.add_row(self._tree(), self._items())
            head = Text(f"{self._header}  {self._clock:.1f} s", style="bold")
            if self._keys is not None:
                paused = self._control is not None and self._control.paused
                head.append(f"   {HELP_PAUSED if paused else HELP}", style="yellow" if paused else "dim")
            return Group(head, page)

    def _show(self, wanted: bool) -> None:
        """Take the terminal and its keyboard, or leave them to others who want to write and read there."""
        try:
            (self._live.start if wanted else self._live.stop)()
        finally:
            if self._keys is not None:
                (self._keys.listen if wanted else self._keys.leave)()

    def _tree(self) -> RenderableType:
        """Return the running path and its surroundings: a whole mission is taller than a terminal."""
        shown = opened(self._outline, {path for path, status in self._status.items() if status == "RUNNING"})
        lines = Text()
        for node, branch in zip(shown, branches(shown), strict=True):
            mark, style = _MARKS.get(self._status.get(node.path, ""), ("·", "dim"))
            lines.append(branch, style="dim")
            lines.append(f"{mark} {node.name}", style=style)
            lines.append(f"  {self._why.get(node.path, '')}\n", style="dim")
        return lines

    def _items(self) -> RenderableType:
        table = Table(box=None, header_style="dim", padding=(0, 1))
        for column in ("item", "class", "state", "bin"):
            table.add_column(column)
        for row in self.items.rows:
            state = Text(row.state, style=_STATES.get(row.state, ""))
            table.add_row(Text(row.item), Text(row.label), state, Text(row.bin))
        return table
