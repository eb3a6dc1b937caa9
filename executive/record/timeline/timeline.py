"""Timeline of a run: the fold of its events, for running and recorded runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

from executive import events
from executive.record.timeline.activation import Activation, Reading
from executive.record.timeline.items import ItemsTimeline


@dataclass
class PlanningTotals:
    """Planned motions, including repeated plans and plans without a solution.

    Attributes:
        motions: Number of planned motions.
        ahead: Number of motions that were planned before a skill asked for them.
        waited_s: Time that was spent waiting for plans [s].
    """

    motions: int = 0
    ahead: int = 0
    waited_s: float = 0.0


@dataclass
class Timeline:
    """Fold of the events of a run; an observer.

    Attributes:
        history: True to keep all activations and selections; otherwise the memory depends only on the size of
            the mission and on the number of items.
        started, ended: Start and end of the run, or None.
        tick, clock: Control step and time of the last event [s].
        nodes: Last activation of each node, by path.
        counts: Number of ended activations of each node by status, by path.
        last_end: The activation that ended last, or None.
        halted: Paths of the skills that were halted since a node last started, succeeded or failed.
        activations: All activations in the order of their starts.
        items: Events of the items.
        targets: Last selection of each item, by name.
        selections: Time of each selection [s], and its item.
        planning: Counts of the planned motions.
        question: The question that the operator has not answered, or None.
        requests: Requests of the operator; None for the request to quit.
        faults: Time of each injected fault [s], and its name.
        traceback: Traceback of the exception that ended the run, or "".
    """

    history: bool = True
    started: events.RunStarted | None = None
    ended: events.RunEnded | None = None
    tick: int = 0
    clock: float = 0.0
    nodes: dict[str, Activation] = field(default_factory=dict)
    counts: dict[str, Counter[str]] = field(default_factory=dict)
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
    _count: int = 0
    _readings: dict[str, Reading] = field(default_factory=dict)

    @staticmethod
    def of(recorded: Iterable[events.TimedEvent]) -> Timeline:
        """Return the timeline of a recorded run; running activations last until the last event."""
        timeline = Timeline()
        for timed in recorded:
            timeline(timed)
        for running in timeline.find_running():
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
                self._start(event)
            case events.NodeEnded():
                self._end(event)
            case events.BranchChosen():
                self._choose(event)
            case events.ItemChanged():
                self.items.change(event, self.clock, is_final=self._is_over())
            case events.FrameSearched():
                self.items.add_look(event, self.clock)
            case events.TargetSelected():
                self.targets[event.item] = event
                if self.history:
                    self.selections.append((self.clock, event.item))
            case events.MotionPlanned():
                self.planning.motions += 1
                self.planning.ahead += event.ahead
                self.planning.waited_s += event.waits
            case events.OperatorAsked():
                self.question = event
            case events.RequestGiven():
                self.question = None
                self.requests.append(event.wanted)
            case events.FaultInjected():
                self.faults.append((self.clock, event.name))
            case events.FaultRaised():
                self.traceback = event.traceback
            case events.RunStarted():
                self.started = event
            case events.RunEnded():
                self.ended = event

    def find_running(self) -> list[Activation]:
        """Return the activations that have not ended, in the order of their starts."""
        found = (last for last in self.nodes.values() if last.status == "RUNNING")
        return sorted(found, key=lambda last: last.number)

    def current(self, path: str) -> Activation | None:
        """Return the last activation of a node, or None if an ancestor of the node has started since then."""
        last = self.nodes.get(path)
        above = path.rpartition("/")[0]
        while last is not None and above:
            ancestor = self.nodes.get(above)
            if ancestor is not None and ancestor.number > last.number:
                return None
            above = above.rpartition("/")[0]
        return last

    def _is_over(self) -> bool:
        """Return True if the tree has ended."""
        root = self.nodes.get(self._root)
        return root is not None and root.status != "RUNNING"

    def _start(self, event: events.NodeStarted) -> None:
        interrupted = self.nodes.get(event.node)
        if interrupted is not None and interrupted.status == "RUNNING":
            # A resumed run restarts the nodes that were running.
            self._close(interrupted, "INVALID")
        self._root = self._root or event.node
        self._count += 1
        now = (self.tick, self.clock)
        started = Activation(event.node, self._count, event.skill, event.item, "RUNNING", *now, *now)
        self.nodes[event.node] = started
        self.halted = ()
        if self.history:
            self.activations.append(started)

    def _end(self, event: events.NodeEnded) -> None:
        ended = self.nodes.get(event.node)
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
        self.counts.setdefault(activation.node, Counter())[status] += 1
        self.last_end = activation

    def _choose(self, event: events.BranchChosen) -> None:
        node = self.nodes.get(event.node)
        if node is None:
            return
        node.choice = event.choice
        if event.reason:
            node.handled[event.reason] += 1
            node.messages[event.reason] = event.message
            node.last_handled = event.reason

    def _add_reading(self, event: events.InputRead) -> None:
        self._readings.pop(event.name, None)
        # The diagnosis quotes values of these types, but no poses, images or lists.
        if isinstance(event.value, (bool, int, float, str)):
            reading = Reading(event.name, event.value, event.raised, self.tick, self.clock)
            self._readings[event.name] = reading
