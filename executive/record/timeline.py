"""Timeline of a running or recorded run: state and history of nodes and items, computed from the events."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, cast

from executive import events
from executive.events import DetectedObject, FrameSearched, ItemChanged

STATUS_TEXTS = {"SUCCESS": "done", "FAILURE": "failed", "INVALID": "halted", "RUNNING": "running"}
"""Text for each status, in the order of the texts in `format_counts`."""


@dataclass
class Activation:
    """One execution of a node, from its start to its end.

    Attributes:
        node: Path of the node.
        number: Number of this activation among all activations in the run, from 1.
        skill: Name of the skill; "" for a control node.
        item: Item that the skill works on, or "".
        status: `RUNNING`, `SUCCESS`, `FAILURE` or `INVALID`.
        start_tick, end_tick: Control steps of start and end; equal while the node is running.
        start, end: Times of start and end [s]; equal while the node is running.
        reason, message: Reason and message of the failure or fault, or "".
        choice: Last decision of a control node as text (`attempt 2 of 3`), or "".
        handled_counts: Number of failures that a control node handled, by name (`Grasp.missed`).
        message_by_reason: Last message of each handled failure, by name of the failure.
        last_handled_reason: Name of the last handled failure, or "".
        halted_skills: Paths of the skills that the control node halted before its end.
    """

    node: str
    number: int
    skill: str
    item: str
    status: str
    start_tick: int
    start: float
    end_tick: int
    end: float
    reason: str = ""
    message: str = ""
    choice: str = ""
    handled_counts: Counter[str] = field(default_factory=Counter)
    message_by_reason: dict[str, str] = field(default_factory=dict)
    last_handled_reason: str = ""
    halted_skills: tuple[str, ...] = ()

    @property
    def failure(self) -> str:
        """Text with the reason and the message of the failure, or ""."""
        return ": ".join(filter(None, (self.reason, self.message)))

    @property
    def reason_or_item(self) -> str:
        """Reason of the failure; without a failure, the name of the item."""
        return self.reason or self.item


@dataclass(frozen=True)
class Look:
    """Look: camera image with the detections of one detector.

    In the last look in which an item was detected, `found` is None, and the last six attributes describe the
    item; otherwise these are None.

    Attributes:
        frame: Number of the frame.
        camera, detector: Names of the camera and of the detector.
        clock: Time of the look on the clock of the run [s].
        found: Number of confident detections.
        item: Name of the item.
        attempts: Number of failed attempts to pick the item.
        looks: Number of looks in which the item was detected, including this look.
        label, confidence: Class and confidence of the detection nearest to the item.
        position: Position `(3,)` of the detection nearest to the item [m].
    """

    omits_none: ClassVar[bool] = True

    frame: int
    camera: str
    detector: str
    clock: float
    found: int | None = None
    item: str | None = None
    attempts: int | None = None
    looks: int | None = None
    label: str | None = None
    confidence: float | None = None
    position: Sequence[float] | None = None


@dataclass
class ItemHistory:
    """History of one item.

    Attributes:
        item: Name of the item.
        look: Last look in which the item was detected, or None.
        later_looks: Number of looks after `look`.
        held_at, dropped_at: Times of the last pick and the last drop of the item [s], or None.
        last_failure: Reason, time and message of the last failure of a skill that worked on the item, or "".
    """

    item: str
    look: Look | None = None
    later_looks: int = 0
    held_at: float | None = None
    dropped_at: float | None = None
    last_failure: str = ""


@dataclass
class ItemsTimeline:
    """Last changes and histories of all items, updated from the events of a run.

    Attributes:
        changes: Last change of each item by name, in the order of the first changes.
        change_times: Time of the last change of the state of each item by name [s].
        tree_end_states: State of each item by name at the end of the tree; final states follow later.
        histories: History of each item by name.
        look: Last look, or None.
        classes: Detected classes as keys, in the order of their first detections.
        _detected_items: Names of the items that were detected in the current look.
    """

    changes: dict[str, ItemChanged] = field(default_factory=dict)
    change_times: dict[str, float] = field(default_factory=dict)
    tree_end_states: dict[str, str] = field(default_factory=dict)
    histories: dict[str, ItemHistory] = field(default_factory=dict)
    look: Look | None = None
    classes: dict[str, None] = field(default_factory=dict)
    _detected_items: list[str] = field(default_factory=list)

    def add_change(self, event: ItemChanged, clock: float, *, is_after_tree_end: bool) -> None:
        """Add a change of an item at the time `clock` [s]."""
        name = event.item
        last = self.changes.get(name)
        history = self.histories.setdefault(name, ItemHistory(name))
        if event.looks > (last.looks if last else 0):
            self._detected_items.append(name)
        if last is None or event.state != last.state:
            self.change_times[name] = clock
            if event.state == "held":
                history.held_at = clock
            elif event.state == "dropped":
                history.dropped_at = clock
        self.changes[name] = event
        if not is_after_tree_end:
            self.tree_end_states[name] = event.state

    def add_look(self, event: FrameSearched, clock: float) -> None:
        """Add a look at the time `clock` [s], after `add_change` added the changes of all detected items."""
        self.look = Look(event.frame, event.camera, event.detector, clock, len(event.confident))
        # The colours follow the order of `classes`; sorting keeps them equal in most runs of a mission.
        self.classes |= dict.fromkeys(sorted(detection.label for detection in event.confident))
        for history in self.histories.values():
            history.later_looks += 1
        for name in self._detected_items:
            history = self.histories[name]
            history.look = _describe_item(self.look, self.changes[name], event.confident)
            history.later_looks = 0
        self._detected_items.clear()

    def find_items_in_states(self, *states: str) -> dict[str, ItemChanged]:
        """Return the items whose state at the tree's end is in `states`, except placed items and phantoms."""
        return {
            name: last
            for name, last in self.changes.items()
            if self.tree_end_states.get(name) in states and last.state not in ("placed", "phantom")
        }


def _describe_item(look: Look, item: ItemChanged, detections: Sequence[DetectedObject]) -> Look:
    """Return `look` with the values of an item and of the detection nearest to its position."""
    look = replace(look, found=None, item=item.item, attempts=item.attempts, looks=item.looks)
    if not detections:
        return look
    nearest = min(detections, key=lambda detection: math.dist(detection.position, item.position))
    return replace(look, label=nearest.label, confidence=nearest.confidence, position=nearest.position)


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
        has_history: True to store all activations, selections and items; False to limit the memory in a long
            run: the items in emptied bins are forgotten.
        started, ended: Events of the start and the end of the run, or None.
        ends: Ends and resumptions of the run.
        tick, clock: Control step and time of the last event [s].
        activation_by_path: Last activation of each node, by path of the node.
        end_counts: Number of ended activations by status, for each node by path.
        halted_skills: Paths of the skills halted after the last start, success or failure of a node.
        activations: All activations in the order of their starts.
        items: History of the items.
        selections: Last selection of each item as a target, by name of the item.
        selection_times: Time [s] and item of each selection of a target.
        failures: Last failed activation of a skill that worked on an item, by name of the item.
        planning: Statistics of motion planning.
        question: Question to the operator that is not yet answered, or None.
        requests: Requests of the operator; None for the request to quit.
        unexplained: What no item explains, by its name, the last shown last.
        faults: Time [s] and name of each injected fault.
        traceback: Traceback of the exception that ended the run, or "".
    """

    has_history: bool = True
    started: events.RunStarted | None = None
    ended: events.RunEnded | None = None
    ends: list[events.TimedEvent] = field(default_factory=list)
    tick: int = 0
    clock: float = 0.0
    activation_by_path: dict[str, Activation] = field(default_factory=dict)
    end_counts: dict[str, Counter[str]] = field(default_factory=dict)
    halted_skills: tuple[str, ...] = ()
    activations: list[Activation] = field(default_factory=list)
    items: ItemsTimeline = field(default_factory=ItemsTimeline)
    selections: dict[str, events.TargetSelected] = field(default_factory=dict)
    selection_times: list[tuple[float, str]] = field(default_factory=list)
    failures: dict[str, Activation] = field(default_factory=dict)
    planning: PlanningTotals = field(default_factory=PlanningTotals)
    question: events.OperatorAsked | None = None
    requests: list[str | None] = field(default_factory=list)
    unexplained: dict[str, events.UnexplainedChanged] = field(default_factory=dict)
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
            running.end_tick = timeline.tick
            running.end = timeline.clock
        return timeline

    def __call__(self, timed: events.TimedEvent) -> None:
        """Add an event."""
        self.tick = timed.tick
        self.clock = timed.clock
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
            case events.UnexplainedChanged():
                self.unexplained.pop(event.name, None)
                if event.is_open:
                    self.unexplained[event.name] = event
            case events.FaultInjected():
                self.faults.append((self.clock, event.name))
            case events.FaultRaised():
                self.traceback = event.traceback
            case events.BinsEmptied(bins) if not self.has_history:
                self._forget_items(bins)
            case events.RunStarted():
                self.started = event
            case events.RunResumed():
                self.ends.append(timed)
            case events.RunEnded():
                self.ended = event
                self.ends.append(timed)

    def find_running_activations(self) -> list[Activation]:
        """Return the activations that have not ended, in the order of their starts."""
        activations = (each for each in self.activation_by_path.values() if each.status == "RUNNING")
        return sorted(activations, key=lambda activation: activation.number)

    @property
    def root(self) -> Activation | None:
        """Last activation of the root of the tree, which starts before all other nodes; None at first."""
        return next(iter(self.activation_by_path.values()), None)

    def _forget_items(self, bins: Sequence[str]) -> None:
        """Forget phantoms and the items in emptied bins."""
        items = self.items
        tables = (items.changes, items.change_times, items.tree_end_states, items.histories)
        for name, last in list(items.changes.items()):
            if last.state == "phantom" or (last.state == "placed" and last.bin in bins):
                for table in (*tables, self.selections, self.failures):
                    cast("dict[str, object]", table).pop(name, None)

    def _add_start(self, event: events.NodeStarted) -> None:
        interrupted = self.activation_by_path.get(event.node)
        if interrupted is not None and interrupted.status == "RUNNING":
            # A resumed run restarts the nodes that were running at the interruption.
            self._end_activation(interrupted, "INVALID")
        self._activation_count += 1
        activation = Activation(
            event.node, self._activation_count, event.skill, event.item, "RUNNING",
            self.tick, self.clock, self.tick, self.clock,
        )  # fmt: skip
        self.activation_by_path[event.node] = activation
        self.halted_skills = ()
        if self.has_history:
            self.activations.append(activation)

    def _add_end(self, event: events.NodeEnded) -> None:
        activation = self.activation_by_path.get(event.node)
        if activation is None or activation.status != "RUNNING":
            return
        self._end_activation(activation, event.status)
        activation.reason = event.reason
        activation.message = event.message
        activation.item = event.item or activation.item
        if event.status != "INVALID":
            activation.halted_skills = self.halted_skills
            self.halted_skills = ()
        elif event.skill:
            self.halted_skills += (event.node,)
        if event.skill and event.status == "FAILURE":
            self.failures[event.item] = activation
            if history := self.items.histories.get(event.item):
                skill = get_skill_name(event.node)
                history.last_failure = f"{skill}.{event.reason} at {self.clock:.2f} s: {event.message}"

    def _end_activation(self, activation: Activation, status: str) -> None:
        activation.status = status
        activation.end_tick = self.tick
        activation.end = self.clock
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


def group_by_node(activations: Iterable[Activation]) -> dict[str, list[Activation]]:
    """Return the activations of each node, by path of the node."""
    activations_by_node: dict[str, list[Activation]] = {}
    for activation in activations:
        activations_by_node.setdefault(activation.node, []).append(activation)
    return activations_by_node


def format_counts(activations: Iterable[Activation]) -> str:
    """Return the number of activations with each status as text: `3 done, 1 failed`."""
    counts = Counter(activation.status for activation in activations)
    return ", ".join(f"{counts[status]} {text}" for status, text in STATUS_TEXTS.items() if counts[status])


def find_last_failure(activations: Sequence[Activation]) -> str:
    """Return reason and message of the last failed activation, or "" if no activation failed."""
    failures = (activation.failure for activation in reversed(activations) if activation.status == "FAILURE")
    return next(failures, "")


def get_skill_name(path: str) -> str:
    """Return the name or label of a skill from its path `.../name` or `.../key:name`."""
    return path.rpartition("/")[2].rpartition(":")[2]
