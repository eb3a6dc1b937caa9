"""Fault scripts: lists of scheduled faults of a cell, which tests inject into runs.

Examples of faults in a script for `run_mission(faults=[...])`:

* The second grasp fails: `during("*/Grasp", seal_fails(), activations=2)`
* The detector does not answer from 4 s to 9 s: `between(4.0, 9.0, detector_hangs())`
* The object nearest to the tool is removed at 12 s: `after(12.0, object_removed("nearest"))`

An effect lasts until its fault ends, or happens once if its docstring says so. An effect on detectors
concerns the requests that a skill makes while the fault lasts.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from functools import cached_property, partial
from typing import Any, Literal

import numpy as np

from executive.cell.arm import Motion, Planning
from executive.cell.frame import Answer
from executive.cell.json_values import round_values
from executive.cell.protocols import Request
from executive.cell.proxy import Access, intercept
from executive.cell.workcell import CellWrapper, TrueObject, Workcell
from executive.errors import Fault, InputError, NoDepth, Unavailable, Unreachable
from executive.events import Emit, FaultInjected, NodeEnded, NodeStarted, TimedEvent, discard_event
from executive.geometry import Array
from executive.testing.oracle import WorldAccess

MAX_ITEM_POSITION_ERROR = 0.05
"""Maximum horizontal distance between the position of an item in the ledger and its true object [m]."""
TIME_TOLERANCE = 1e-9
"""Tolerance for rounding errors in comparisons of times on the run's clock [s]."""
UNSURE_CONFIDENCE_FRACTION = 0.9
"""Maximum confidence of the detections of an unsure detector, as a fraction of its threshold."""
BUMP_DISTANCE = 0.06
"""Displacement of an object that is bumped aside [m]."""
BUMP_DIRECTION_COUNT = 8
"""Number of evenly spaced directions that are tried, in order, for a free position of a bumped object."""
ObjectChoice = int | Literal["node", "nearest"]
"""Choice of an object: the number of an object, from 1; `nearest` to the tool; or the object of the `node`.

`node` chooses the true object of the item that the node handles, or the nearest object without an item.
"""
Interval = tuple[float, float]
"""Minimum and maximum of a coordinate [m]."""
AnswerChange = Callable[[Answer], Answer]
"""Function that returns a changed answer of a detector, or raises Unavailable."""
_INTERCEPTED_ROLES = ("arm", "tool", "camera", "detector", "localizer", "operator")
"""Parts of the cell that effects can change or observe."""


@dataclass(frozen=True)
class Effect:
    """Stateless effect of a fault on a cell: an action, or changed results of calls.

    Attributes:
        name: Name of the effect in the journal.
        action: Function `action(occurrence, *arguments)`, which is called when the effect begins and after
            each control step until the function returns True. The function changes the cell and returns True,
            or returns False if the change is not possible yet. None: no action.
        interceptors: Functions `interceptor(proceed, occurrence, *arguments)`, by the name of the method of
            the cell whose result they return: `close`, `open` (tool), `plan` (arm), `sees_table`, `capture`
            (camera), `request` (detector), `localize` (localizer), `ask` (operator). `proceed()` calls the
            method.
        arguments: Further arguments of the action and of the interceptors.
        fraction: Fraction of a motion of the arm before which no action occurs, 0 to 1; None: no condition.
    """

    name: str
    action: Callable[..., bool] | None = None
    interceptors: Mapping[str, Callable[..., Any]] = field(default_factory=dict)
    arguments: tuple[Any, ...] = ()
    fraction: float | None = None


@dataclass(frozen=True)
class ScheduledFault:
    """A fault of a script: an effect on the cell, and the nodes or the time span in which it occurs.

    Attributes:
        effect: Effect of the fault.
        pattern: Pattern of the paths of the nodes during which the fault occurs; `*` matches any text, also
            with `/`. "": the fault occurs in a time span.
        activations: Numbers of the affected activations, counted from 1 over all matching nodes; empty: all.
        start, end: Time span on the run's clock, from `start` (included) to `end` (excluded) [s].
    """

    effect: Effect
    pattern: str = ""
    activations: tuple[int, ...] = ()
    start: float = 0.0
    end: float = math.inf

    def __str__(self) -> str:
        """Return a description of the fault."""
        return f"{self.effect.name} from {self.start:g} s" if not self.pattern else self.effect.name


def during(pattern: str, effect: Effect, *, activations: int | Collection[int] = ()) -> ScheduledFault:
    """Return a fault that lasts while a node runs.

    Args:
        pattern: Pattern that the path of the node matches, for instance `*/Grasp`.
        effect: Effect of the fault.
        activations: One or more numbers of activations, counted from 1 over all matching nodes; empty: all.

    Raises:
        InputError: A number is less than 1.
    """
    numbers = (activations,) if isinstance(activations, int) else tuple(activations)
    if any(number < 1 for number in numbers):
        raise InputError(f"the number of an activation must be at least 1, not {activations}")
    return ScheduledFault(effect, pattern, numbers)


def between(start: float, end: float, effect: Effect) -> ScheduledFault:
    """Return a fault that lasts from `start` (included) to `end` (excluded) on the run's clock [s].

    Raises:
        InputError: `start` is negative, or not before `end`.
    """
    if not 0.0 <= start < end:
        raise InputError(f"a fault needs times with 0 <= start < end, not {start:g} s and {end:g} s")
    return ScheduledFault(effect, start=start, end=end)


def after(start: float, effect: Effect) -> ScheduledFault:
    """Return a fault that lasts from `start` on the run's clock [s] until the end of the run."""
    return between(start, math.inf, effect)


def with_faults(
    make_cell: Callable[..., Workcell], faults: Sequence[ScheduledFault], timeout: float = math.inf
) -> Callable[..., FaultyCell]:
    """Return a function that makes cells with a fault script, for `RunOptions.make_cell`.

    The cell must observe the run: `run.add_observer(run.workcell.on_event)`.

    Args:
        make_cell: Function that makes the cells without faults.
        faults: Fault script.
        timeout: Time on the run's clock after which the run ends as a fault [s].
    """

    def make_faulty_cell(*args: Any, emit: Emit = discard_event, **options: Any) -> FaultyCell:
        return FaultyCell(make_cell(*args, emit=emit, **options), faults, emit, timeout)

    return make_faulty_cell


def seal_fails() -> Effect:
    """Return an effect: the cup cannot seal, and `Grasp` fails with `missed`; held objects stay held."""
    return Effect("seal_fails", interceptors={"close": _return_constant}, arguments=(None,))


def object_unsealable(choice: ObjectChoice) -> Effect:
    """Return an effect: the cup cannot seal on one object, and `Grasp` fails with `missed` on this object.

    Args:
        choice: Number of the object, from 1; `nearest` to the tool; or `node` for the object of the node.
    """
    return Effect("seal_fails", interceptors={"close": _prevent_seal}, arguments=(choice,))


def seal_breaks(fraction: float | None = 0.5) -> Effect:
    """Return an effect: the seal breaks once, the object falls, and `Transit` fails with `dropped`.

    Args:
        fraction: Fraction of the motion after which the seal breaks, 0 to 1; None: at once, also at rest.
    """
    return Effect("seal_breaks", _break_seal, fraction=fraction)


def tool_does_not_release() -> Effect:
    """Return an effect: the object sticks to the opened tool, and `Release` fails with `stuck`."""
    return Effect("tool_does_not_release", interceptors={"open": _prevent_opening})


def arm_collides(obstacle: str = "something", fraction: float = 0.5) -> Effect:
    """Return an effect: the arm collides once and brakes, and the skill fails with `blocked`.

    Args:
        obstacle: Name of the obstacle in the message of the failure.
        fraction: Fraction of the motion after which the arm collides, 0 to 1.
    """
    return Effect("arm_collides", _collide_arm, arguments=(obstacle,), fraction=fraction)


def no_path() -> Effect:
    """Return an effect: planning fails, and skills that move the arm fail with `unreachable`."""
    return Effect("no_path", interceptors={"plan": _change_answer}, arguments=(_raise_unreachable,))


def workspace_occluded() -> Effect:
    """Return an effect: the camera does not see the whole table, and `Detect` fails with `hidden`."""
    return Effect("workspace_occluded", interceptors={"sees_table": _return_constant}, arguments=(False,))


def no_depth() -> Effect:
    """Return an effect: no detection can be localized, and `Localize` fails with `no_depth`."""
    return Effect("no_depth", interceptors={"localize": _raise_no_depth})


def table_bumped() -> Effect:
    """Return an effect: the table is bumped once; skills with older frames or targets fail with `stale`."""
    return Effect("table_bumped", _bump_table)


def operator_quits() -> Effect:
    """Return an effect: the operator quits, and `AwaitRequest` fails with `quit`."""
    return Effect("operator_quits", interceptors={"ask": _return_constant}, arguments=(None,))


def operator_asks_rescan() -> Effect:
    """Return an effect: the operator requests a new scan, and `AwaitRequest` fails with `rescan`."""
    return Effect("operator_asks_rescan", interceptors={"ask": _return_constant}, arguments=("rescan",))


def object_removed(choice: ObjectChoice = "node", fraction: float | None = None) -> Effect:
    """Return an effect: an object is removed once, even from the tool.

    Args:
        choice: Number of the object, from 1; `nearest` to the tool; or `node` for the object of the node.
        fraction: Fraction of the motion of the arm after which the effect begins, 0 to 1; None: at once.
    """
    return Effect("object_removed", _change_object, arguments=(choice, WorldAccess.remove), fraction=fraction)


def object_moved(
    displacement: tuple[float, float], choice: ObjectChoice = "node", fraction: float | None = None
) -> Effect:
    """Return an effect: an object is displaced once.

    Args:
        displacement: Displacement along x and y [m]; a simulated object there is pushed aside.
        choice: Number of the object, from 1; `nearest` to the tool; or `node` for the object of the node.
        fraction: Fraction of the motion of the arm after which the effect begins, 0 to 1; None: at once.
    """
    arguments = (choice, WorldAccess.move, displacement)
    return Effect("object_moved", _change_object, arguments=arguments, fraction=fraction)


def object_bumped(
    x: Interval, y: Interval, choice: ObjectChoice = "node", fraction: float | None = None
) -> Effect:
    """Return an effect: an object is bumped aside once, by `BUMP_DISTANCE`, to a free position.

    Args:
        x: Allowed interval of x of the new position [m].
        y: Allowed interval of y of the new position [m].
        choice: Number of the object, from 1; `nearest` to the tool; or `node` for the object of the node.
        fraction: Fraction of the motion of the arm after which the effect begins, 0 to 1; None: at once.
    """
    return Effect("object_moved", _bump_object, arguments=(choice, x, y), fraction=fraction)


def detector_dead() -> Effect:
    """Return an effect: requests fail instead of an answer, and `Detect` fails with `unavailable`."""
    return make_detector_effect("detector_dead", _raise_unavailable)


def detector_hangs() -> Effect:
    """Return an effect: requests are answered when the fault ends; a node that ends before gets no answer."""
    return make_detector_effect("detector_hangs", hangs=True)


def detector_unsure() -> Effect:
    """Return an effect: all confidences are below the threshold, and `Detect` fails with `unsure`."""
    return make_detector_effect("detector_unsure", _reduce_confidence)


def detector_finds_nothing() -> Effect:
    """Return an effect: nothing is detected, and `Detect` succeeds with an empty list."""
    return make_detector_effect("detector_finds_nothing", _remove_detections)


def make_detector_effect(name: str, change_answer: AnswerChange | None = None, hangs: bool = False) -> Effect:
    """Return an effect: the detector answers with changed answers, or not before the end of the fault.

    Args:
        name: Name of the effect in the journal.
        change_answer: Function that changes an answer of the detector; None: no change.
        hangs: True if the detector answers no request before the end of the fault.
    """
    return Effect(name, interceptors={"request": _change_answer}, arguments=(change_answer, hangs))


class FaultyCell(CellWrapper):
    """A work cell with injected faults; implements `Workcell`.

    Faults of nodes occur only if `on_event` observes the events of the run. Each fault emits `FaultInjected`.

    Args:
        inner: The cell without faults.
        faults: Fault script.
        emit: Function that emits events of the run.
        timeout: Time on the run's clock after which the run ends as a fault [s].
    """

    def __init__(
        self, inner: Workcell, faults: Sequence[ScheduledFault],
        emit: Emit = discard_event, timeout: float = math.inf,
    ) -> None:  # fmt: skip
        super().__init__(inner)
        self.emit = emit
        self._timeout = timeout
        self._node_faults = [fault for fault in faults if fault.pattern]
        self._time_faults = [fault for fault in faults if not fault.pattern]
        self._activation_counts: Counter[int] = Counter()
        self._occurrences: list[Occurrence] = []
        # Last motion of the arm and its start time [s]; None before a motion and after a stop.
        self._motion: tuple[Motion, float] | None = None
        self.cell = intercept(inner.cell, self._intercept_access, _INTERCEPTED_ROLES)

    @cached_property
    def world(self) -> WorldAccess:
        """Access to the world of the cell, opened at the first use."""
        return WorldAccess(self.inner)

    @property
    def motion_progress(self) -> float:
        """Elapsed fraction of the current motion, 0 to 1; 0 without a motion or after its end."""
        if self._motion is None or self._motion[0].duration == 0.0:
            return 0.0
        motion, start_time = self._motion
        fraction = (self.cell.clock.now - start_time) / motion.duration
        return fraction if fraction <= 1.0 else 0.0

    def on_event(self, timed: TimedEvent) -> None:
        """Begin or end the faults of a node; must be called with each event of the run on this cell."""
        match timed.event:
            case NodeStarted(node, _, item):
                for index, fault in enumerate(self._node_faults):
                    if fnmatchcase(node, fault.pattern):
                        # Each fault counts the activations of all nodes that match its pattern.
                        self._activation_counts[index] += 1
                        number = self._activation_counts[index]
                        if not fault.activations or number in fault.activations:
                            self._begin_occurrence(Occurrence(fault.effect, self, node, item))
            case NodeEnded(node):
                self._end_occurrences(lambda occurrence: occurrence.node == node)

    def check_patterns(self, paths: Sequence[str]) -> None:
        """Check that the pattern of each fault matches at least one of these `paths` of nodes.

        Raises:
            InputError: A pattern matches no path.
        """
        for fault in self._node_faults:
            if not any(fnmatchcase(path, fault.pattern) for path in paths):
                problem = f'the pattern "{fault.pattern}" of {fault.effect.name} matches no path of a node'
                raise InputError(f"{problem}; the paths are: {', '.join(paths)}")

    def advance(self) -> None:
        """Advance the cell by one control step, and inject the faults that are due.

        Raises:
            Fault: The timeout has expired; later calls do not raise it again, so that the arm can brake.
        """
        self.inner.advance()
        self._update_occurrences()
        if self.cell.clock.now > self._timeout:
            timeout = self._timeout
            self._timeout = math.inf
            raise Fault(f"the mission has not ended after {timeout:g} s on its clock")

    def _update_occurrences(self) -> None:
        """Begin and end the faults with a time span, and run the actions of the active faults."""
        now = self.cell.clock.now + TIME_TOLERANCE
        due_faults = [fault for fault in self._time_faults if fault.start <= now]
        self._time_faults = [fault for fault in self._time_faults if fault.start > now]
        for fault in due_faults:
            self._begin_occurrence(Occurrence(fault.effect, self, end=fault.end))
        self._end_occurrences(lambda occurrence: occurrence.end <= now)
        for occurrence in self._occurrences:
            occurrence.run_action()

    def _begin_occurrence(self, occurrence: Occurrence) -> None:
        self._occurrences.append(occurrence)
        occurrence.run_action()

    def _end_occurrences(self, has_ended: Callable[[Occurrence], bool]) -> None:
        for occurrence in filter(has_ended, list(self._occurrences)):
            occurrence.is_over = True
            self._occurrences.remove(occurrence)

    def _intercept_access(self, access: Access) -> Any:
        """Return the result of an access to the cell, changed by all active effects."""
        proceed = access.proceed
        if access.is_call:
            self._update_occurrences()
            for occurrence in self._occurrences:
                if interceptor := occurrence.effect.interceptors.get(access.member):
                    proceed = partial(interceptor, proceed, occurrence, *occurrence.effect.arguments)
        result = proceed()
        if access.name == "arm.start":
            self._motion = access.all_arguments[0], self.cell.clock.now
        elif access.name == "arm.stop":
            self._motion = None
        return result


@dataclass(eq=False)
class Occurrence:
    """One occurrence of an effect.

    Attributes:
        effect: The effect.
        context: The faulty cell.
        node: Path of the node during which the effect occurs, or "".
        item: Item that the node handles, or "".
        end: Time on the run's clock at which the effect ends [s].
        has_acted: True if the action has changed the cell.
        is_over: True if the effect has ended.
        _last_event_time: Time on the run's clock of the last event [s].
    """

    effect: Effect
    context: FaultyCell
    node: str = ""
    item: str = ""
    end: float = math.inf
    has_acted: bool = False
    is_over: bool = False
    _last_event_time: float = -math.inf

    def run_action(self) -> None:
        """Run the action of the effect, unless it has changed the cell already."""
        has_moved = self.context.motion_progress >= (self.effect.fraction or 0.0)
        if self.effect.action is not None and not self.has_acted and has_moved:
            self.has_acted = self.effect.action(self, *self.effect.arguments)

    def find_object(self, choice: ObjectChoice) -> TrueObject | None:
        """Return the chosen object, or None if no object matches."""
        cell = self.context.cell
        world = self.context.world
        max_distance = math.inf
        position: Sequence[float] | Array = cell.arm.tool_pose.position
        if isinstance(choice, int):
            return next(iter(world.objects[choice - 1 : choice]), None)
        if choice == "node" and self.item:
            entries = self.context.accounts.list_items()
            summary = next((entry for entry in entries if entry.item == self.item), None)
            if summary is None or summary.state == "placed":
                return None
            if summary.state == "held":
                return world.held_object
            position = summary.position
            max_distance = MAX_ITEM_POSITION_ERROR

        def measure_distance(true_object: TrueObject) -> float:
            return math.dist(true_object.position[:2], position[:2])

        held_object = world.held_object
        candidates = [
            true_object
            for true_object in world.objects
            if not any(bin.contains(true_object.position) for bin in cell.bins.values())
            and (held_object is None or true_object.body != held_object.body)
            and measure_distance(true_object) <= max_distance
        ]
        return min(candidates, key=measure_distance, default=None)

    def emit_event(self, affected: TrueObject | None = None) -> None:
        """Emit a `FaultInjected` event with the affected object; at most one event per control step."""
        now = self.context.cell.clock.now
        if self._last_event_time == now:
            return
        self._last_event_time = now
        label = affected.label if affected else ""
        position = round_values(affected.position, 4) if affected else []
        self.context.emit(FaultInjected(self.effect.name, self.node, self.item, label, position))


def _return_constant(proceed: Callable[[], object], occurrence: Occurrence, answer: object) -> object:
    """Return `answer` without calling the method of the cell."""
    del proceed
    occurrence.emit_event()
    return answer


def _prevent_seal(proceed: Callable[[], None], occurrence: Occurrence, choice: ObjectChoice) -> None:
    """Close the tool, unless the chosen object is the object below the tool."""
    chosen_object = occurrence.find_object(choice)
    touched_object = occurrence.find_object("nearest")
    if chosen_object and touched_object and chosen_object.body == touched_object.body:
        occurrence.emit_event(chosen_object)
    else:
        proceed()


def _prevent_opening(proceed: Callable[[], None], occurrence: Occurrence) -> None:
    """Open the tool only if it is empty."""
    held_object = occurrence.context.world.held_object
    if held_object is None:
        proceed()
    else:
        occurrence.emit_event(held_object)


def _break_seal(occurrence: Occurrence) -> bool:
    held_object = occurrence.context.world.held_object
    if held_object is not None:
        occurrence.emit_event(held_object)
        occurrence.context.world.cell.tool.break_seal()
    return held_object is not None


def _collide_arm(occurrence: Occurrence, obstacle: str) -> bool:
    occurrence.emit_event()
    occurrence.context.world.cell.arm.stop_after_collision(f"the arm ran into {obstacle}")
    return True


def _raise_unreachable(motion: Motion) -> Motion:
    del motion
    raise Unreachable("the planner finds no motion (injected fault)")


def _raise_no_depth(proceed: Callable[[], Any], occurrence: Occurrence) -> Any:
    del proceed
    occurrence.emit_event()
    raise NoDepth("the frame has no depth there (injected fault)")


def _bump_table(occurrence: Occurrence) -> bool:
    occurrence.emit_event()
    occurrence.context.cell.ledger.invalidate_positions()
    return True


def _change_object(
    occurrence: Occurrence, choice: ObjectChoice, change: Callable[..., None], *arguments: object
) -> bool:
    """Call `change(world, true_object, *arguments)`; return False if no object matches."""
    true_object = occurrence.find_object(choice)
    if true_object is not None:
        occurrence.emit_event(true_object)
        change(occurrence.context.world, true_object, *arguments)
    return true_object is not None


def _bump_object(occurrence: Occurrence, choice: ObjectChoice, x: Interval, y: Interval) -> bool:
    """Displace an object to the first free position; return False if no tried position is free."""
    if (bumped_object := occurrence.find_object(choice)) is None:
        return False
    classes = occurrence.context.cell.classes
    for angle in np.linspace(0.0, 2 * math.pi, BUMP_DIRECTION_COUNT, endpoint=False):
        displacement = (BUMP_DISTANCE * math.cos(angle), BUMP_DISTANCE * math.sin(angle))
        position = bumped_object.position[:2] + displacement
        distances = [
            math.dist(position, neighbour.position[:2]) - classes[neighbour.label].radius
            for neighbour in occurrence.context.world.objects
            if neighbour.body != bumped_object.body
        ]
        is_free = min(distances, default=math.inf) > classes[bumped_object.label].radius
        if is_free and x[0] <= position[0] <= x[1] and y[0] <= position[1] <= y[1]:
            return _change_object(occurrence, choice, WorldAccess.move, displacement)
    return False


@dataclass
class _FaultyAnswer:
    """A pending answer with a fault; implements `Request` and `Planning`.

    Attributes:
        pending: The pending answer without a fault.
        occurrence: Occurrence of the fault during which the answer was requested.
        change_answer: Function that changes the answer, or raises an error; None: no change.
        hangs: True if there is no answer during the occurrence.
    """

    pending: Request | Planning
    occurrence: Occurrence
    change_answer: Callable[[Any], Any] | None
    hangs: bool = False

    @property
    def ready(self) -> bool:
        return self.pending.ready and (self.occurrence.is_over or not self.hangs)

    def result(self) -> Any:
        answer = self.pending.result()
        return answer if self.change_answer is None else self.change_answer(answer)


def _change_answer(proceed: Callable[[], Any], occurrence: Occurrence, *arguments: Any) -> _FaultyAnswer:
    occurrence.emit_event()
    return _FaultyAnswer(proceed(), occurrence, *arguments)


def _raise_unavailable(answer: Answer) -> Answer:
    raise Unavailable(f"detector {answer.detector}: the detector is dead (injected fault)")


def _reduce_confidence(answer: Answer) -> Answer:
    """Return an answer whose confidences are below the threshold."""
    max_confidence = UNSURE_CONFIDENCE_FRACTION * answer.error_rates.threshold
    detections = sorted((*answer.confident, *answer.doubtful), key=lambda detection: -detection.confidence)
    doubtful = tuple(replace(found, confidence=min(found.confidence, max_confidence)) for found in detections)
    return replace(answer, confident=(), doubtful=doubtful, unknown=())


def _remove_detections(answer: Answer) -> Answer:
    return replace(answer, confident=(), doubtful=(), unknown=())
