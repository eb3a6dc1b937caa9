"""State of a recorded run at a control step, for a frame of a film."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from executive.events import FaultRaised, NodeEnded, RunHalted, RunResumed, TimedEvent
from executive.mission.outline import OutlineNode
from executive.record.timeline.activation import Activation, to_skill_name
from executive.record.timeline.timeline import Timeline
from executive.view.tree.tree_text import find_skill_names

FAILURE_DISPLAY_TIME = 1.6
"""Time for which a film shows a failure, on the clock of the run [s]."""


class FilmRunState:
    """State of a run at a control step, computed from the events up to that step.

    Args:
        events: Events of the run in order, without the events that a resumption discarded.
        nodes: Nodes of the tree.
        image_files: Image files on which decisions are based; their names start with the control step.

    Attributes:
        timeline: Timeline of the events up to the control step.
        picture_file: File of the last image up to the control step; None before the first image.
        time: Start of the control step on the clock of the run [s].
    """

    def __init__(
        self, events: Sequence[TimedEvent], nodes: Sequence[OutlineNode], image_files: Sequence[Path]
    ) -> None:
        self.timeline = Timeline(keeps_history=False)
        self.picture_file: Path | None = None
        self.time = 0.0
        self._events = list(events)[::-1]
        self._image_files = sorted(image_files, reverse=True)
        self._skill_names_by_path = find_skill_names(nodes)
        self._failure: tuple[float, str] = (-FAILURE_DISPLAY_TIME, "")

    @property
    def active_paths(self) -> frozenset[str]:
        """Paths of the running nodes, or after the run of the nodes that ended with the tree."""
        timeline = self.timeline
        if running := timeline.find_running_activations():
            return frozenset(activation.node for activation in running)
        end = _get_end_key(timeline.last_end)
        activations = timeline.activation_by_path.items()
        return frozenset(path for path, activation in activations if _get_end_key(activation) == end)

    @property
    def failure_text(self) -> str:
        """Text about a failure within the last `FAILURE_DISPLAY_TIME`; "" if there is none."""
        time, text = self._failure
        return text if self.time < time + FAILURE_DISPLAY_TIME else ""

    @property
    def action_text(self) -> str:
        """Text with the first running skill, its item, and the bin of a held item; "" if no skill runs."""
        timeline = self.timeline
        for path, name in self._skill_names_by_path.items():
            last = timeline.activation_by_path.get(path)
            if last is not None and last.status == "RUNNING":
                item, target = timeline.items.by_name.get(last.item), timeline.targets.get(last.item)
                is_held = item is not None and item.last_change.state == "held"
                bin_text = f"to {target.bin}" if target is not None and is_held else ""
                return " ".join(part for part in (name, last.item, bin_text) if part)
        return ""

    def advance_to(self, step: int, time: float) -> None:
        """Add the events up to a control step, which began at `time` on the clock of the run [s]."""
        self.time = time
        while self._events and self._events[-1].tick <= step:
            timed_event = self._events.pop()
            self.timeline(timed_event)
            if failure := _describe_incident(timed_event):
                self._failure = (timed_event.clock, failure)
        while self._image_files and int(self._image_files[-1].stem.partition("_")[0]) <= step:
            self.picture_file = self._image_files.pop()


def _get_end_key(activation: Activation | None) -> tuple[int, str]:
    """Return the control step and the status with which an activation ended; (0, "") for None."""
    return (0, "") if activation is None else (activation.end_tick, activation.status)


def _describe_incident(timed_event: TimedEvent) -> str:
    """Return a text about the failure of a skill with an item, a halt, a fault or a resumption; else ""."""
    match timed_event.event:
        case NodeEnded(status="FAILURE", skill=skill, item=item) as ended if skill and item:
            return f"{to_skill_name(ended.node)}.{ended.reason}: {ended.message}"
        case RunHalted():
            return "halt"
        case FaultRaised():
            return "fault"
        case RunResumed():
            return "resumed"
    return ""
