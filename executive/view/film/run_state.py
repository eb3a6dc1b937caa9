"""Record of a run as the source of a film, and state of the run at the control step that a frame shows."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from pathlib import Path

from executive.cells.sim.command_log import is_command_log
from executive.errors import InputError
from executive.events import FaultRaised, ItemChanged, NodeEnded, RunHalted, RunResumed, TimedEvent
from executive.mission.outline import OutlineNode
from executive.record.journal import find_run_end, find_run_start, read_journal
from executive.record.recorded_mission import read_cell, read_tree
from executive.record.result import read_result
from executive.record.run_directory import RunDirectory
from executive.record.timeline.activation import Activation, get_skill_name
from executive.record.timeline.timeline import Timeline
from executive.replay.input_log import InputLog
from executive.view.tree.tree_text import find_skill_names

INCIDENT_DISPLAY_TIME = 1.6
"""Time on the clock of the run for which a film shows a failure, halt or resumption [s]."""


class FilmSource:
    """Record of a run in a simulated cell, as the source of a film.

    Attributes:
        directory: Run directory.
        events: Events of the journal in order, without the events that a resumption discarded.
        start: Event of the start of the run.
        nodes: Nodes of the tree.
        config: Configuration of the cell.
        bin_colours: Colour of each bin in the format `#rrggbb` of Pillow, by bin name.
        item_count: Number of items in the run.
        outcome: Result from result.json, or else from the journal; None for an interrupted run.

    Raises:
        InputError: The journal, the tree, the cell or the log of the world is missing in the record.
    """

    def __init__(self, directory: RunDirectory) -> None:
        problem = f'the run in "{directory.path}" cannot be filmed'
        if not directory.world_log.exists():
            advice = "Run the mission again with `executive run` and the same seed, and film that run"
            raise InputError(
                f"{problem}: it has no world.log, from which its world is simulated again; sweeps do not "
                f"keep this file. {advice}"
            )
        if not is_command_log(directory.world_log):
            advice = "film a run on a cell of `kind: sim`"
            raise InputError(f"{problem}: its cell has no simulated world; {advice}")
        events = read_journal(directory.journal)
        self.directory = directory
        self.start = find_run_start(events, directory.path, "there is nothing to film")
        self.events = InputLog(events).events
        self.nodes = read_tree(directory.tree)
        self.config = read_cell(directory.path)
        self.bin_colours = {
            name: "#" + bytes(round(255 * channel) for channel in bin_config.colour).hex()
            for name, bin_config in self.config.bins.items()
        }
        changes = (timed.event for timed in self.events if isinstance(timed.event, ItemChanged))
        self.item_count = len({change.item for change in changes})
        self.outcome = read_result(directory, events) or find_run_end(events)


class FilmRunState:
    """State of a run at a control step, computed from the events up to that step.

    Args:
        events: Events of the run in order, without the events that a resumption discarded.
        nodes: Nodes of the tree.
        image_files: Files of images on which decisions are based; each name starts with the control step.

    Attributes:
        timeline: Timeline of the events up to the control step.
        image_file: File of the last image up to the control step; None before the first image.
        time: Start of the control step on the clock of the run [s].
    """

    def __init__(
        self, events: Sequence[TimedEvent], nodes: Sequence[OutlineNode], image_files: Sequence[Path]
    ) -> None:
        self.timeline = Timeline(has_history=False)
        self.image_file: Path | None = None
        self.time = 0.0
        self._later_events = deque(events)
        self._later_image_files = deque(sorted(image_files))
        self._skill_names_by_path = find_skill_names(nodes)
        self._last_incident, self._last_incident_time = "", 0.0

    @property
    def active_paths(self) -> frozenset[str]:
        """Paths of the running nodes; after the run, paths of the nodes that ended together with the tree."""
        timeline = self.timeline
        if running := timeline.find_running_activations():
            return frozenset(activation.node for activation in running)
        end = _get_end_key(timeline.root)
        activations = timeline.activation_by_path.items()
        return frozenset(path for path, activation in activations if _get_end_key(activation) == end)

    @property
    def incident_text(self) -> str:
        """Text about a failure, halt or resumption within the last `INCIDENT_DISPLAY_TIME`; else ""."""
        return self._last_incident if self.time < self._last_incident_time + INCIDENT_DISPLAY_TIME else ""

    @property
    def action_text(self) -> str:
        """Name of the first running skill, its item, and the bin of a held item; "" if no skill runs."""
        timeline = self.timeline
        for path, name in self._skill_names_by_path.items():
            activation = timeline.activation_by_path.get(path)
            if activation is not None and activation.status == "RUNNING":
                item = timeline.items.by_name.get(activation.item)
                target = timeline.selections.get(activation.item)
                is_held = item is not None and item.last_change.state == "held"
                bin_text = f"to {target.bin}" if target is not None and is_held else ""
                return " ".join(filter(None, (name, activation.item, bin_text)))
        return ""

    def advance_to(self, step: int, time: float) -> None:
        """Process the events up to a control step, which began at `time` on the clock of the run [s]."""
        self.time = time
        while self._later_events and self._later_events[0].tick <= step:
            timed_event = self._later_events.popleft()
            self.timeline(timed_event)
            if text := _describe_incident(timed_event):
                self._last_incident, self._last_incident_time = text, timed_event.clock
        while self._later_image_files and int(self._later_image_files[0].stem.partition("_")[0]) <= step:
            self.image_file = self._later_image_files.popleft()


def _get_end_key(activation: Activation | None) -> tuple[int, str]:
    """Return the control step and the status with which an activation ended; (0, "") for None."""
    return (0, "") if activation is None else (activation.end_tick, activation.status)


def _describe_incident(timed_event: TimedEvent) -> str:
    """Return a text about a failed skill with an item, a halt, a fault or a resumption; else ""."""
    match timed_event.event:
        case NodeEnded(status="FAILURE") as event if event.skill and event.item:
            return f"{get_skill_name(event.node)}.{event.reason}: {event.message}"
        case RunHalted():
            return "halt"
        case FaultRaised():
            return "fault"
        case RunResumed():
            return "resumed"
    return ""
