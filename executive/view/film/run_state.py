"""State of a recorded run at the control step that a film frame shows."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from pathlib import Path

from executive.events import FaultRaised, NodeEnded, RunHalted, RunResumed, TimedEvent
from executive.mission.outline import OutlineNode
from executive.record.timeline.activation import Activation, get_skill_name
from executive.record.timeline.timeline import Timeline
from executive.view.tree.tree_text import find_skill_names

INCIDENT_DISPLAY_TIME = 1.6
"""Time on the clock of the run for which a film shows a failure, halt or resumption [s]."""


class FilmRunState:
    """State of a run at a control step, computed from the events up to that step.

    Args:
        events: Events of the run in order, without the events that a resumption discarded.
        nodes: Nodes of the tree.
        image_files: Files of images on which decisions are based; each name starts with the control step.

    Attributes:
        timeline: Timeline of the events up to the control step.
        picture_file: File of the last image up to the control step; None before the first image.
        time: Start of the control step on the clock of the run [s].
    """

    def __init__(
        self, events: Sequence[TimedEvent], nodes: Sequence[OutlineNode], image_files: Sequence[Path]
    ) -> None:
        self.timeline = Timeline(has_history=False)
        self.picture_file: Path | None = None
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
            self.picture_file = self._later_image_files.popleft()


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
