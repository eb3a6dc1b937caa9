"""Timeline of a running or recorded run: state and history of nodes and items, computed from the events."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

from executive import events
from executive.record.timeline.activation import Activation, Reading
from executive.record.timeline.items import ItemsTimeline


@dataclass
class PlanningTotals:
    """Statistics of motion planning.

    Attributes:
        motions: Number of planned motions, including repeated plans and plans without a solution.
        ahead: Number of motions that were planned before a skill requested them.
        waited_s: Total time spent waiting for plans [s].
    """

    motions: int = 0
    ahead: int = 0
    waited_s: float = 0.0


@dataclass
class Timeline:
    """Observer that computes the state and the history of a run from its events.

    Attributes:
        keeps_history: True to store all activations and selections; otherwise the memory depends only on the
            number of nodes and items.
        started, ended: Events of the start and the end of the run, or None.
        tick, clock: Control step and time of the last event [s].
        activation_by_path: Last activation of each node, by path of the node.
        end_counts: Number of ended activations by status, for each node by path.
        last_end: The activation that ended last, or None.
        halted: Paths of the skills that were halted since the last start, success or failure of a node.
        activations: All activations in the order of their starts.
        items: History of the items.
        targets: Last selection of each item as a target, by name of the item.
        selections: Time [s] and item of each selection of a target.
        planning: Statistics of motion planning.
        question: Question to the operator that is not yet answered, or None.
        requests: Requests of the operator; None for the request to quit.
        faults: Time [s] and name of each injected fault.
        traceback: Traceback of the exception that ended the run, or "".
    """

    keeps_history: bool = True
    started: events.RunStarted | None = None
    ended: events.RunEnded | None = None
    tick: int = 0
    clock: float = 0.0
    activation_by_path: dict[str, Activation] = field(default_factory=dict)
    end_counts: dict[str, Counter[str]] = field(default_factory=dict)
    last_end: Activation | None = None
    halted: tuple[str, ...] = ()
    activations: list[Activation] = field(default_factory=list)
    items: ItemsTimeline = field(default_factory=ItemsTimeline)
    targets: dict[str, events.TargetSelected] = field(default_factory=dict)
    selections: list[tuple[float, str]] = field(default_factory=list)
    planning: PlanningTotals = field(default_factory=PlanningTotals)
    question: events.OperatorAsked | None = None
    requests: list[str | None] = field(default_factory=list)
    faults: list[tuple[float, str]] = field(default_factory=list)
    traceback: str = ""
    _root: str = ""
    _activation_count: int = 0
    _readings: dict[str, Reading] = field(default_factory=dict)

    @staticmethod
    def from_events(recorded: Iterable[events.TimedEvent]) -> Timeline:
        """Return the timeline of a recorded run; activations without end last until the last event."""
        timeline = Timeline()
        for timed in recorded:
            timeline(timed)
        for running in timeline.find_running_activations():
            running.end_tick, running.end = timeline.tick, timeline.clock
        return timeline

    def __call__(self, timed: events.TimedEvent) -> None:
        """Add an event."""
        self.tick, self.clock = timed.tick, timed.clock
        event = timed.event
        match event:
            case events.InputRead():
                self._add_reading(event)
            case events.NodeStarted():
                self._start_activation(event)
            case events.NodeEnded():
                self._end_activation(event)
            case events.BranchChosen():
                self._add_choice(event)
            case events.ItemChanged():
                self.items.add_change(event, self.clock, is_after_tree_end=self._has_tree_ended())
            case events.FrameSearched():
                self.items.add_look(event, self.clock)
            case events.TargetSelected():
                self.targets[event.item] = event
                if self.keeps_history:
                    self.selections.append((self.clock, event.item))
            case events.MotionPlanned():
                self.planning.motions += 1
                self.planning.ahead += event.planned_ahead
                self.planning.waited_s += event.delay
            case events.OperatorAsked():
                self.question = event
            case events.RequestGiven():
                self.question = None
                self.requests.append(event.request)
            case events.FaultInjected():
                self.faults.append((self.clock, event.name))
            case events.FaultRaised():
                self.traceback = event.traceback
            case events.RunStarted():
                self.started = event
            case events.RunEnded():
                self.ended = event

    def find_running_activations(self) -> list[Activation]:
        """Return the activations that have not ended, in the order of their starts."""
        running = (last for last in self.activation_by_path.values() if last.status == "RUNNING")
        return sorted(running, key=lambda last: last.number)

    def find_current_activation(self, path: str) -> Activation | None:
        """Return the last activation of a node, or None if an ancestor of the node was started after it."""
        last = self.activation_by_path.get(path)
        ancestor_path = path.rpartition("/")[0]
        while last is not None and ancestor_path:
            ancestor = self.activation_by_path.get(ancestor_path)
            if ancestor is not None and ancestor.number > last.number:
                return None
            ancestor_path = ancestor_path.rpartition("/")[0]
        return last

    def _has_tree_ended(self) -> bool:
        """Return True if the tree has ended."""
        root = self.activation_by_path.get(self._root)
        return root is not None and root.status != "RUNNING"

    def _start_activation(self, event: events.NodeStarted) -> None:
        interrupted = self.activation_by_path.get(event.node)
        if interrupted is not None and interrupted.status == "RUNNING":
            # A resumed run restarts the nodes that were running at the interruption.
            self._close(interrupted, "INVALID")
        self._root = self._root or event.node
        self._activation_count += 1
        number, now = self._activation_count, (self.tick, self.clock)
        activation = Activation(event.node, number, event.skill, event.item, "RUNNING", *now, *now)
        self.activation_by_path[event.node] = activation
        self.halted = ()
        if self.keeps_history:
            self.activations.append(activation)

    def _end_activation(self, event: events.NodeEnded) -> None:
        ended = self.activation_by_path.get(event.node)
        if ended is None or ended.status != "RUNNING":
            return
        self._close(ended, event.status)
        ended.reason, ended.message = event.reason, event.message
        ended.item = event.item or ended.item
        if event.status != "INVALID":
            ended.halted, self.halted = self.halted, ()
        elif event.skill:
            self.halted += (event.node,)
        if event.skill and event.reason:
            ended.readings = tuple(self._readings.values())
        if event.skill and event.status == "FAILURE" and event.item in self.items.by_name:
            self.items.by_name[event.item].failure = ended

    def _close(self, activation: Activation, status: str) -> None:
        activation.status, activation.end_tick, activation.end = status, self.tick, self.clock
        self.end_counts.setdefault(activation.node, Counter())[status] += 1
        self.last_end = activation

    def _add_choice(self, event: events.BranchChosen) -> None:
        last = self.activation_by_path.get(event.node)
        if last is None:
            return
        last.choice = event.choice
        if event.reason:
            last.handled_counts[event.reason] += 1
            last.message_by_reason[event.reason] = event.message
            last.last_handled_reason = event.reason

    def _add_reading(self, event: events.InputRead) -> None:
        self._readings.pop(event.name, None)
        # The diagnosis quotes only values of these types, not poses, images or lists.
        if isinstance(event.value, (bool, int, float, str)):
            reading = Reading(event.name, event.value, event.exception, self.tick, self.clock)
            self._readings[event.name] = reading
