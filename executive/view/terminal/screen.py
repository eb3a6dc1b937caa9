"""Live view of a run in a terminal: the running branches of the tree, the items, the time, and the keys."""

from __future__ import annotations

import contextlib
import os
import select
import termios
import threading
import tty
from collections.abc import Sequence

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from executive.errors import escape_control_characters
from executive.events import OperatorAsked, RequestGiven, TimedEvent
from executive.mission.outline import OutlineNode, make_outline
from executive.record.timeline import Timeline
from executive.run.run import Run
from executive.run.run_control import RunControl
from executive.view.tree.tree_text import draw_line_prefixes, select_active_nodes

REDRAWS_PER_SECOND = 10
"""Frequency at which the view is drawn [1/s]."""
POLL_PERIOD = 0.1
"""Maximum time until the reading thread notices that it must end [s]."""
PAUSE_KEYS, STEP_KEY = (b"p", b" "), b"s"
"""Keys that pause or continue a run, and key that runs one control step."""
HELP = "p pause, s step, Ctrl-C stop"
"""Text about the keys while the run is not paused."""
HELP_PAUSED = "paused: p continue, s step, Ctrl-C stop"
"""Text about the keys while the run is paused."""

_STATUS_MARKS = {"RUNNING": ("▶", "bold yellow"), "SUCCESS": ("✓", "green"), "FAILURE": ("✗", "red")}
"""Character and style of the mark of a node, by the status of the node; any other node has a dim dot."""
_STATE_STYLES = {"placed": "green", "rejected": "red", "lost": "red", "held": "yellow", "dropped": "yellow"}
"""Style of the text of an item state; the text of any other state has no style."""


class TerminalView:
    """Live view that a separate thread draws, so that a slow terminal does not slow down the run.

    If `keyboard`, the file descriptor of a terminal, is not None, keys on this terminal control the run.
    """

    def __init__(self, console: Console, keyboard: int | None = None) -> None:
        self._console = console
        self._keyboard = keyboard
        self._key_reader: KeyReader | None = None
        self._nodes: Sequence[OutlineNode] = ()
        self._lock = threading.Lock()
        self.timeline = Timeline(has_history=False)
        self._live = Live(
            console=console, get_renderable=self.render, refresh_per_second=REDRAWS_PER_SECOND, transient=True
        )

    def open(self, run: Run) -> None:
        """Show the view of a run, and start to read keys that control the run."""
        self._nodes = make_outline(run.root)
        if self._keyboard is not None:
            self._key_reader = KeyReader(self._keyboard, run.control)
        self._show()

    def __call__(self, timed: TimedEvent) -> None:
        """Update the view by an event; hide the view while the operator is asked for a request."""
        if isinstance(timed.event, OperatorAsked):
            self.close()
        elif isinstance(timed.event, RequestGiven):
            self._show()
        with self._lock:
            self.timeline(timed)

    def close(self) -> None:
        """Hide the view, for a question to the operator or for a summary, and stop reading keys."""
        try:
            self._live.stop()
        finally:
            if self._key_reader is not None:
                self._key_reader.stop()

    def show_message(self, message: str) -> None:
        """Write a message about the record of the run on a separate line."""
        text = escape_control_characters(message)
        self._console.print(Text(f"note: {text}", style="yellow"))

    def render(self) -> RenderableType:
        """Return the drawing of the current state of the run."""
        with self._lock:
            grid = Table.grid(padding=(0, 4))
            grid.add_row(self._render_tree(), self._render_items())
            start_event = self.timeline.started
            title = "" if start_event is None else f"{start_event.mission}  seed {start_event.seed}"
            header = Text(f"{title}  {self.timeline.clock:.1f} s", style="bold")
            if self._key_reader is not None:
                is_paused = self._key_reader.control.is_paused
                help_text, style = (HELP_PAUSED, "yellow") if is_paused else (HELP, "dim")
                header.append(f"   {help_text}", style=style)
            return Group(header, grid)

    def _show(self) -> None:
        """Show the view, and start to read keys."""
        try:
            self._live.start()
        finally:
            if self._key_reader is not None:
                self._key_reader.start()

    def _render_tree(self) -> RenderableType:
        """Return a drawing of the running nodes and their children; all nodes may need too much space."""
        running_paths = {activation.node for activation in self.timeline.find_running_activations()}
        shown_nodes = select_active_nodes(self._nodes, running_paths)
        lines = Text()
        for node, prefix in zip(shown_nodes, draw_line_prefixes(shown_nodes), strict=True):
            activation = self.timeline.activation_by_path.get(node.path)
            mark, style = _STATUS_MARKS.get(activation.status if activation else "", ("·", "dim"))
            note = escape_control_characters(activation.reason_or_item) if activation else ""
            lines.append(prefix, style="dim")
            lines.append(f"{mark} {node.name}", style=style)
            lines.append(f"  {note}\n", style="dim")
        return lines

    def _render_items(self) -> RenderableType:
        """Return a table of the items of the run."""
        table = Table(box=None, header_style="dim", padding=(0, 1))
        for column in ("item", "class", "state", "bin"):
            table.add_column(column)
        for item in self.timeline.items.list_items():
            state = Text(item.state, style=_STATE_STYLES.get(item.state, ""))
            table.add_row(Text(item.item), Text(item.label), state, Text(item.bin))
        return table


class KeyReader:
    """Thread that reads single keys from the file descriptor of a terminal, and controls a run."""

    def __init__(self, descriptor: int, control: RunControl) -> None:
        self.control = control
        self._descriptor = descriptor
        self._saved_attributes = termios.tcgetattr(descriptor)
        self._must_stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Start the thread unless it is running; Ctrl-C still sends a signal while the thread reads keys."""
        if self._thread is not None:
            return
        tty.setcbreak(self._descriptor)
        self._must_stop.clear()
        self._thread = threading.Thread(target=self._read_keys, name="keys", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop the thread, and restore the line mode of the terminal."""
        if self._thread is None:
            return
        self._must_stop.set()
        self._thread.join()
        self._thread = None
        termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._saved_attributes)

    def _read_keys(self) -> None:
        """Handle keys until the thread must stop or the terminal is closed."""
        with contextlib.suppress(OSError):
            while not self._must_stop.is_set():
                if select.select([self._descriptor], [], [], POLL_PERIOD)[0]:
                    key = os.read(self._descriptor, 1)
                    if not key:
                        return
                    self._handle_key(key)

    def _handle_key(self, key: bytes) -> None:
        if key == STEP_KEY:
            self.control.step()
        elif key in PAUSE_KEYS and self.control.is_paused:
            self.control.resume()
        elif key in PAUSE_KEYS:
            self.control.pause()
