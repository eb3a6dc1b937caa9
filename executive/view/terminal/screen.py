"""Live view in a terminal: the tree with its running path, the items, and the clock."""

from __future__ import annotations

import threading
from collections.abc import Sequence

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from executive.errors import escape_control_characters
from executive.events import OperatorAsked, RequestGiven, TimedEvent
from executive.mission.outline import OutlineNode, outline
from executive.record.timeline.timeline import Timeline
from executive.run.run import Run
from executive.run.run_control import RunControl
from executive.view.terminal.keys import HELP, HELP_PAUSED, Keys
from executive.view.tree.outline import draw_line_prefixes, select_running

REDRAWS_PER_SECOND = 10
"""Frequency of drawing [1/s]."""

_MARKS = {
    "RUNNING": ("▶", "bold yellow"),
    "SUCCESS": ("✓", "green"),
    "FAILURE": ("✗", "red"),
    "INVALID": ("·", "dim"),
}
_STATES = {"placed": "green", "rejected": "red", "lost": "red", "held": "yellow", "dropped": "yellow"}


class Terminal:
    """Live view that a thread redraws ten times per second.

    The tick thread only updates the timeline, so a slow terminal does not slow down the run.

    Args:
        console: The terminal.
        keyboard: File descriptor of the terminal's keyboard; None: keys do nothing.

    Attributes:
        timeline: Timeline of the run.
    """

    def __init__(self, console: Console, keyboard: int | None = None) -> None:
        self._console = console
        self._keyboard = keyboard
        self._control: RunControl | None = None
        self._keys: Keys | None = None
        self._outline: Sequence[OutlineNode] = ()
        self._lock = threading.Lock()
        self.timeline = Timeline(history=False)
        self._live = Live(
            console=console, get_renderable=self.render, refresh_per_second=REDRAWS_PER_SECOND, transient=True
        )

    def open(self, run: Run) -> None:
        """Draw the tree, and begin to read keys that control the run."""
        self._outline = outline(run.root)
        self._control = run.control
        if self._keyboard is not None:
            self._keys = Keys(self._keyboard, run.control)
        self._set_visible(True)

    def __call__(self, timed: TimedEvent) -> None:
        """Show an event; hide the view while the operator answers a question."""
        if isinstance(timed.event, OperatorAsked | RequestGiven):
            self._set_visible(isinstance(timed.event, RequestGiven))
        with self._lock:
            self.timeline(timed)

    def close(self) -> None:
        """Hide the view; the summary is printed afterwards."""
        self._set_visible(False)

    def note(self, sentence: str) -> None:
        """Write `sentence` on a line of its own."""
        text = escape_control_characters(sentence)
        self._console.print(Text(f"note: {text}", style="yellow"))

    def render(self) -> RenderableType:
        """Return the view of this moment."""
        with self._lock:
            page = Table.grid(padding=(0, 4))
            page.add_row(self._render_tree(), self._render_items())
            started = self.timeline.started
            title = "" if started is None else f"{started.mission}  seed {started.seed}"
            head = Text(f"{title}  {self.timeline.clock:.1f} s", style="bold")
            if self._keys is not None:
                paused = self._control is not None and self._control.is_paused
                head.append(f"   {HELP_PAUSED if paused else HELP}", style="yellow" if paused else "dim")
            return Group(head, page)

    def _set_visible(self, is_visible: bool) -> None:
        """Show the view and read keys, or release the terminal and its keyboard for others."""
        try:
            (self._live.start if is_visible else self._live.stop)()
        finally:
            if self._keys is not None:
                (self._keys.listen if is_visible else self._keys.stop)()

    def _render_tree(self) -> RenderableType:
        """Return the running nodes and their neighbours: a whole tree is taller than a terminal."""
        shown = select_running(self._outline, {running.node for running in self.timeline.find_running()})
        lines = Text()
        for node, branch in zip(shown, draw_line_prefixes(shown), strict=True):
            last = self.timeline.nodes.get(node.path)
            mark, style = _MARKS.get(last.status if last else "", ("·", "dim"))
            note = escape_control_characters(last.note) if last else ""
            lines.append(branch, style="dim")
            lines.append(f"{mark} {node.name}", style=style)
            lines.append(f"  {note}\n", style="dim")
        return lines

    def _render_items(self) -> RenderableType:
        table = Table(box=None, header_style="dim", padding=(0, 1))
        for column in ("item", "class", "state", "bin"):
            table.add_column(column)
        for row in self.timeline.items.now():
            state = Text(row.state, style=_STATES.get(row.state, ""))
            table.add_row(Text(row.item), Text(row.label), state, Text(row.bin))
        return table
