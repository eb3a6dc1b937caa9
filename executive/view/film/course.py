"""State of a recorded run at each of its control steps, as a film shows it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from executive.events import FaultRaised, NodeEnded, RunHalted, RunResumed, TimedEvent
from executive.mission.outline import OutlineNode
from executive.record.timeline.activation import Activation, skill_name
from executive.record.timeline.timeline import Timeline
from executive.view.tree.outline import find_skill_names

FAILURE_TIME = 1.6
"""Time for which a failure is shown [s]."""


class FilmCourse:
    """Follows the events of a run up to a control step.

    Args:
        events: Events of the run that no resumption made void, in order.
        nodes: The tree.
        pictures: Images on which decisions are based; their names begin with the control step.

    Attributes:
        timeline: Timeline of the run so far.
        picture: The last image; None before the first.
        clock: Time of the control step [s].
    """

    def __init__(
        self, events: Sequence[TimedEvent], nodes: Sequence[OutlineNode], pictures: Sequence[Path]
    ) -> None:
        self.timeline = Timeline(history=False)
        self.picture: Path | None = None
        self.clock = 0.0
        self._events = list(events)[::-1]
        self._pictures = sorted(pictures, reverse=True)
        self._skills = find_skill_names(nodes)
        self._failure: tuple[float, str] = (-FAILURE_TIME, "")

    @property
    def open_paths(self) -> frozenset[str]:
        """Paths of the running nodes; after the end of the tree, of those with its end and its status."""
        timeline = self.timeline
        if running := timeline.find_running():
            return frozenset(activation.node for activation in running)
        end = _find_end(timeline.last_end)
        return frozenset(path for path, activation in timeline.nodes.items() if _find_end(activation) == end)

    @property
    def failure(self) -> str:
        """Sentence about a recent failure of an item or the run; "" if there is none."""
        when, sentence = self._failure
        return sentence if self.clock < when + FAILURE_TIME else ""

    @property
    def current_action(self) -> str:
        """The first running skill, its item, and the bin of a held item; "" if no skill runs."""
        timeline = self.timeline
        for path, name in self._skills.items():
            last = timeline.nodes.get(path)
            if last is not None and last.status == "RUNNING":
                item, target = timeline.items.by_name.get(last.item), timeline.targets.get(last.item)
                is_held = item is not None and item.now.state == "held"
                bin = f"to {target.bin}" if target is not None and is_held else ""
                return " ".join(part for part in (name, last.item, bin) if part)
        return ""

    def go_to(self, step: int, clock: float) -> None:
        """Add the events up to a control step, which began at the time `clock` [s]."""
        self.clock = clock
        while self._events and self._events[-1].tick <= step:
            timed = self._events.pop()
            self.timeline(timed)
            if failure := _describe_failure(timed):
                self._failure = (timed.clock, failure)
        while self._pictures and int(self._pictures[-1].stem.partition("_")[0]) <= step:
            self.picture = self._pictures.pop()


def _find_end(activation: Activation | None) -> tuple[int, str]:
    return (0, "") if activation is None else (activation.end_tick, activation.status)


def _describe_failure(timed: TimedEvent) -> str:
    """Return a sentence about an event that concerns an item or the run; "" for other events."""
    match timed.event:
        case NodeEnded(status="FAILURE", skill=skill, item=item) as ended if skill and item:
            return f"{skill_name(ended.node)}.{ended.reason}: {ended.message}"
        case RunHalted():
            return "halt"
        case FaultRaised():
            return "fault"
        case RunResumed():
            return "resumed"
    return ""
