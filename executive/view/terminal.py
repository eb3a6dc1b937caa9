"""Views of a run on a terminal: plain lines, live screen, key commands, and summary."""

from __future__ import annotations

import contextlib
import os
import select
import shlex
import termios
import threading
import tty
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import TextIO

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from executive import events
from executive.errors import escape_control_characters
from executive.events import ItemChanged, OperatorAsked, RequestGiven, TimedEvent
from executive.mission.outline import OutlineNode, make_outline
from executive.perception.evidence import describe_unknown_labels
from executive.record.result import Result, format_diagnosis, make_resume_command, wrap_lines
from executive.record.timeline import STATUS_TEXTS, Timeline
from executive.run.operator import RunControl
from executive.run.run import Run
from executive.view.drawing import draw_line_prefixes, select_active_nodes

REDRAWS_PER_SECOND = 10
"""Frequency at which the view is drawn [1/s]."""
POLL_PERIOD = 0.1
"""Maximum time until the reading thread notices that it must end [s]."""
PAUSE_KEYS = (b"p", b" ")
"""Keys that pause or continue a run."""
STEP_KEY = b"s"
"""Key that runs one control step."""
EMPTY_KEY = b"e"
"""Key that declares that all bins have been emptied."""
HELP = "p pause, s step, e bins emptied, Ctrl-C stop"
"""Text about the keys while the run is not paused."""
HELP_PAUSED = "paused: p continue, s step, e bins emptied, Ctrl-C stop"
"""Text about the keys while the run is paused."""

_STATUS_MARKS = {"RUNNING": ("▶", "bold yellow"), "SUCCESS": ("✓", "green"), "FAILURE": ("✗", "red")}
"""Character and style of the mark of a node, by the status of the node; any other node has a dim dot."""
_STATE_STYLES = {"placed": "green", "rejected": "red", "lost": "red", "held": "yellow", "dropped": "yellow"}
"""Style of the text of an item state; the text of any other state has no style."""


class LineView:
    """Writes a line when a skill starts or ends, a control node decides, or the state of an item changes.

    Starts and ends of control nodes follow from the lines about their skills, and are not written.

    Attributes:
        timeline: Timeline of the run.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._names_by_path: dict[str, str] = {}
        self.timeline = Timeline(has_history=False)

    def open(self, run: Run) -> None:
        """Store the names of the nodes of a run."""
        self._names_by_path = {node.path: node.name for node in make_outline(run.root)}

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
            case events.BinsEmptied():
                return f"emptied: {', '.join(event.bins)}"
            case events.UnexplainedChanged() if event.is_open:
                return f"{event.name}: {event.text}"
            case events.ItemChanged():
                return self._describe_change(event)
        return ""

    def _describe_skill(self, event: events.NodeStarted | events.NodeEnded) -> str:
        # The name of a skill below a key is `recover: Grasp`.
        name = self._names_by_path[event.node].rpartition(": ")[2]
        return f"{name} [{event.item}]" if event.item else name

    def _describe_change(self, change: events.ItemChanged) -> str:
        """Return the text about a changed item; "" if only its position or its counts changed."""
        last = self.timeline.items.changes.get(change.item)
        if last is not None and _get_described_fields(last) == _get_described_fields(change):
            return ""
        bin_text = f" in {change.bin}" if change.state == "placed" and change.bin else ""
        return f"{change.item} {change.state}{bin_text}" + (f": {change.reason}" if change.reason else "")


def _get_described_fields(change: events.ItemChanged) -> tuple[str, ...]:
    return change.label, change.state, change.bin, change.reason


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
        table = Table("item", "class", "state", "bin", box=None, header_style="dim", padding=(0, 1))
        for item in self.timeline.items.changes.values():
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
                    if key == STEP_KEY:
                        self.control.step()
                    elif key == EMPTY_KEY:
                        self.control.empty_bins()
                    elif key in PAUSE_KEYS and self.control.is_paused:
                        self.control.resume()
                    elif key in PAUSE_KEYS:
                        self.control.pause()


def format_repeat_command(
    mission: str, seed: int, overrides: Mapping[str, object], requests: Iterable[str] = (),
    options: Mapping[str, str] = {},
) -> str:  # fmt: skip
    """Return the command line that repeats a run exactly.

    `overrides` contains the params from the command line by name; `requests` are made by the operator;
    `options` contains further options by name; an empty value is omitted.
    """
    arguments = ["executive", "run", mission, "--seed", str(seed)]
    for key, value in overrides.items():
        arguments += ["--set", f"{key}={value}"]
    for request in requests:
        arguments += ["--request", request]
    for name, value in options.items():
        arguments += [f"--{name}", value] if value else []
    return shlex.join(arguments)


def describe_end(status: str, reason: str, node: str, message: str) -> str:
    """Return a line about the end of a run: status, reason, node path and message, without empty parts."""
    # The reason of a fault or a halt repeats the status, and is omitted.
    reason_text = f" {reason}" if reason and reason.upper() != status else ""
    node_text = f" at {node}" if node else ""
    message_text = f": {message}" if message else ""
    return f"{status}{reason_text}{node_text}{message_text}"


def format_summary(
    result: Result, items: Collection[ItemChanged], repeat_command: str, report_file: str = ""
) -> str:
    """Return a text with the end of a run, the times, and the items by bin or by state.

    The diagnosis of a run that did not succeed is at the end, because users read the last lines first.
    `items` contains the last change of each item; `report_file` is "" if there is no report.
    """
    times = f"{result.robot_time_s:.1f} s on the robot's clock, {result.wall_time_s:.1f} s by the wall clock"
    groups = sorted(group_items_by_outcome(items).items())
    outcomes = [f"  {outcome}: {', '.join(names)}" for outcome, names in groups]
    if (emptied_count := result.items.placed - sum(item.state == "placed" for item in items)) > 0:
        outcomes.insert(0, f"  taken out of the bins: {emptied_count}")
    if labels_text := describe_unknown_labels(result.unknown_labels):
        outcomes.append(f"  {labels_text}")
    outcomes += [f"  {entry.name}: {entry.text}" for entry in result.unexplained]
    outcomes += [f"  assumption: {reason}" for reason in result.assumption_reasons]
    warning = wrap_lines(result.disagreement, "", "  ", max_lines=3)
    if result.diagnosis is not None:
        diagnosis = format_diagnosis(result.diagnosis, result.run, repeat_command, report_file)
        lines = [times, *outcomes, "", *diagnosis]
    else:
        end = describe_end(result.status, result.reason, result.node, result.message)
        lines = [end, times, f"{result.run}  (repeat: {repeat_command})", *outcomes]
        lines += [f"report: {report_file}"] if report_file else []
        if result.status == "INCOMPLETE":
            lines.append(f"after you have moved the remaining objects: {make_resume_command(result.run)}")
    return "\n".join([*warning, *lines]) + "\n"


def describe_place_on_table(item: ItemChanged) -> str:
    """Return the position of an item that was rejected or skipped, as text; "" for other items."""
    is_on_table = item.state in ("rejected", "skipped")
    return "x {:.2f} m, y {:.2f} m".format(*item.position) if is_on_table else ""


def group_items_by_outcome(items: Collection[ItemChanged]) -> dict[str, list[str]]:
    """Return names of placed items by bin, and descriptions of the other items by state.

    Phantoms, which are detections without an object, are only counted.
    """
    outcomes: dict[str, list[str]] = defaultdict(list)
    for item in items:
        if item.state == "placed":
            outcomes[item.bin].append(item.item)
        elif item.state != "phantom":
            details = ": ".join(filter(None, (describe_place_on_table(item), item.reason)))
            outcomes[item.state].append(f"{item.item} ({details})" if details else item.item)
    if phantom_count := sum(item.state == "phantom" for item in items):
        outcomes["phantom"].append(f"{phantom_count} detected by mistake")
    return dict(outcomes)
