"""Timeline of a running or recorded run: state and history of nodes and items, computed from the events."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

from executive import events
from executive.record.timeline.activation import Activation
from executive.record.timeline.items import ItemsTimeline


@dataclass
class PlanningTotals:
    """Statistics of motion planning.

    Attributes:
        motions: Number of planned motions, including repeated plans and plans without a solution.
        ahead: Number of motions that were planned before a skill requested them.
        waited_s: Total time for which skills waited for plans [s].
    """

    motions: int = 0
    ahead: int = 0
    waited_s: float = 0.0


@dataclass
class Timeline:
    """Observer that computes the state and the history of a run from its events.

    Attributes:
        has_history: True to store all activations and selections; False to limit the memory in a long run.
        started, ended: Events of the start and the end of the run, or None.
        tick, clock: Control step and time of the last event [s].
        activation_by_path: Last activation of each node, by path of the node.
        end_counts: Number of ended activations by status, for each node by path.
        halted_skills: Paths of the skills halted after the last start, success or failure of a node.
        activations: All activations in the order of their starts.
        items: History of the items.
        selections: Last selection of each item as a target, by name of the item.
        selection_times: Time [s] and item of each selection of a target.
        planning: Statistics of motion planning.
        question: Question to the operator that is not yet answered, or None.
        requests: Requests of the operator; None for the request to quit.
        faults: Time [s] and name of each injected fault.
        traceback: Traceback of the exception that ended the run, or "".
    """

    has_history: bool = True
    started: events.RunStarted | None = None
    ended: events.RunEnded | None = None
    tick: int = 0
    clock: float = 0.0
    activation_by_path: dict[str, Activation] = field(default_factory=dict)
    end_counts: dict[str, Counter[str]] = field(default_factory=dict)
    halted_skills: tuple[str, ...] = ()
    activations: list[Activation] = field(default_factory=list)
    items: ItemsTimeline = field(default_factory=ItemsTimeline)
    selections: dict[str, events.TargetSelected] = field(default_factory=dict)
    selection_times: list[tuple[float, str]] = field(default_factory=list)
    planning: PlanningTotals = field(default_factory=PlanningTotals)
    question: events.OperatorAsked | None = None
    requests: list[str | None] = field(default_factory=list)
    faults: list[tuple[float, str]] = field(default_factory=list)
    traceback: str = ""
    _activation_count: int = 0

    @staticmethod
    def from_events(timed_events: Iterable[events.TimedEvent]) -> Timeline:
        """Return the timeline of a recorded run; the last event ends the running activations."""
        timeline = Timeline()
        for timed in timed_events:
            timeline(timed)
        for running in timeline.find_running_activations():
            running.end_tick, running.end = timeline.tick, timeline.clock
        return timeline

    def __call__(self, timed: events.TimedEvent) -> None:
        """Add an event."""
        self.tick, self.clock = timed.tick, timed.clock
        event = timed.event
        match event:
            case events.NodeStarted():
                self._add_start(event)
            case events.NodeEnded():
                self._add_end(event)
            case events.BranchChosen():
                self._add_choice(event)
            case events.ItemChanged():
                is_after_tree_end = self.root is not None and self.root.status != "RUNNING"
                self.items.add_change(event, self.clock, is_after_tree_end=is_after_tree_end)
            case events.FrameSearched():
                self.items.add_look(event, self.clock)
            case events.TargetSelected():
                self.selections[event.item] = event
                if self.has_history:
                    self.selection_times.append((self.clock, event.item))
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
        activations = (each for each in self.activation_by_path.values() if each.status == "RUNNING")
        return sorted(activations, key=lambda activation: activation.number)

    def find_current_activation(self, path: str) -> Activation | None:
        """Return the last activation of a node, or None if an ancestor was started after this activation."""
        last = self.activation_by_path.get(path)
        ancestor_path = path.rpartition("/")[0]
        while last is not None and ancestor_path:
            ancestor = self.activation_by_path.get(ancestor_path)
            if ancestor is not None and ancestor.number > last.number:
                return None
            ancestor_path = ancestor_path.rpartition("/")[0]
        return last

    @property
    def root(self) -> Activation | None:
        """Last activation of the root of the tree, which starts before all other nodes; None at first."""
        return next(iter(self.activation_by_path.values()), None)

    def _add_start(self, event: events.NodeStarted) -> None:
        interrupted = self.activation_by_path.get(event.node)
        if interrupted is not None and interrupted.status == "RUNNING":
            # A resumed run restarts the nodes that were running at the interruption.
            self._end_activation(interrupted, "INVALID")
        self._activation_count += 1
        number, start = self._activation_count, (self.tick, self.clock)
        activation = Activation(event.node, number, event.skill, event.item, "RUNNING", *start, *start)
        self.activation_by_path[event.node] = activation
        self.halted_skills = ()
        if self.has_history:
            self.activations.append(activation)

    def _add_end(self, event: events.NodeEnded) -> None:
        activation = self.activation_by_path.get(event.node)
        if activation is None or activation.status != "RUNNING":
            return
        self._end_activation(activation, event.status)
        activation.reason, activation.message = event.reason, event.message
        activation.item = event.item or activation.item
        if event.status != "INVALID":
            activation.halted_skills, self.halted_skills = self.halted_skills, ()
        elif event.skill:
            self.halted_skills += (event.node,)
        if event.skill and event.status == "FAILURE" and event.item in self.items.by_name:
            self.items.by_name[event.item].failure = activation

    def _end_activation(self, activation: Activation, status: str) -> None:
        activation.status, activation.end_tick, activation.end = status, self.tick, self.clock
        self.end_counts.setdefault(activation.node, Counter())[status] += 1

    def _add_choice(self, event: events.BranchChosen) -> None:
        activation = self.activation_by_path.get(event.node)
        if activation is None:
            return
        activation.choice = event.choice
        if event.reason:
            activation.handled_counts[event.reason] += 1
            activation.message_by_reason[event.reason] = event.message
            activation.last_handled_reason = event.reason
