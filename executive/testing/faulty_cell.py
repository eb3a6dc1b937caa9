"""Injection of faults at the border of a run: effects, the occurrences of an effect, and their schedule."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import cached_property, partial
from typing import Any, Literal

from executive.cell.arm import Motion
from executive.cell.devices import TrueObject
from executive.cell.json_values import round_values
from executive.errors import Fault, InputError
from executive.events import Emit, FaultInjected, NodeEnded, NodeStarted, TimedEvent, discard_event
from executive.station.border import Access
from executive.station.station import Station
from executive.testing.oracle import WorldAccess

MAX_ITEM_POSITION_ERROR = 0.05
"""Maximum horizontal distance between the position of an item in the ledger and its true object [m]."""
TIME_TOLERANCE = 1e-9
"""Tolerance for rounding errors in comparisons of times on the run's clock [s]."""
ObjectChoice = int | Literal["node", "nearest", "held"]
"""Choice of an object; `executive.testing.faults` describes the values."""


@dataclass(frozen=True)
class Effect:
    """Stateless effect of a fault on a cell: an action, or changed results of calls.

    Attributes:
        name: Name of the effect in the journal.
        action: Function `action(occurrence, *arguments)` that changes the cell and returns True, or returns
            False if the change is not possible yet; it is then called again after each control step.
        interceptors: Functions `interceptor(proceed, occurrence, *arguments)`, by the path of the method
            whose result they return: `tool.close`, `tool.open`, `planner.plan`, `camera.sees_table`,
            `camera.capture`, `detector.request`, `localizer.localize`, `operator.ask`, ...
            (`executive.station.border.METHODS`). `proceed()` calls the method.
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
        pattern: Pattern of the paths of the nodes during which the fault occurs; "": in a time span.
        activations: Numbers of the affected activations, from 1 over all matching nodes; empty: all.
        start, end: Time span on the run's clock, from `start` (included) to `end` (excluded) [s].
    """

    effect: Effect
    pattern: str = ""
    activations: tuple[int, ...] = ()
    start: float = 0.0
    end: float = math.inf

    def __str__(self) -> str:
        return f"{self.effect.name} from {self.start:g} s" if not self.pattern else self.effect.name


class FaultInjector:
    """Injects faults into the run of a station, at the border of the run.

    Faults of nodes occur only if `on_event` observes the events of the run. Each fault emits `FaultInjected`.

    Args:
        faults: Fault script.
        timeout: Time on the run's clock after which the run ends as a fault [s].

    Attributes:
        station: The station; set by `install`.
        emit: Function that emits events of the run; set by `install`.
    """

    station: Station

    def __init__(self, faults: Sequence[ScheduledFault], timeout: float = math.inf) -> None:
        self.emit: Emit = discard_event
        self._timeout = timeout
        self._node_faults = [fault for fault in faults if fault.pattern]
        self._time_faults = [fault for fault in faults if not fault.pattern]
        self._activation_counts: Counter[int] = Counter()
        self._occurrences: list[Occurrence] = []
        # Last motion of the arm and its start time [s]; None before a motion and after a stop.
        self._motion: tuple[Motion, float] | None = None

    def install(self, station: Station, emit: Emit = discard_event) -> None:
        """Inject the faults into the run of a station."""
        self.station = station
        self.emit = emit
        station.border.interceptor = self._intercept_access
        station.tick_callbacks.append(self._advance)

    def wrap(self, make_cell: Callable[..., Station]) -> Callable[..., Station]:
        """Return a factory of stations with these faults, for `RunOptions.make_cell`."""

        def make_faulty_cell(*args: Any, emit: Emit = discard_event, **options: Any) -> Station:
            station = make_cell(*args, emit=emit, **options)
            self.install(station, emit)
            return station

        return make_faulty_cell

    @cached_property
    def world(self) -> WorldAccess:
        """Access to the world of the station, opened at the first use."""
        return WorldAccess(self.station)

    @property
    def motion_progress(self) -> float:
        """Elapsed fraction of the current motion, 0 to 1; 0 without a motion or after its end."""
        if self._motion is None or self._motion[0].duration == 0.0:
            return 0.0
        motion, start_time = self._motion
        fraction = (self.station.driver.clock.now - start_time) / motion.duration
        return fraction if fraction <= 1.0 else 0.0

    def on_event(self, timed: TimedEvent) -> None:
        """Begin or end the faults of a node; must be called with each event of the run."""
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
        """Raise InputError if the pattern of a fault matches none of these `paths` of nodes."""
        for fault in self._node_faults:
            if not any(fnmatchcase(path, fault.pattern) for path in paths):
                raise InputError(
                    f'the pattern "{fault.pattern}" of {fault.effect.name} matches no path of a node; '
                    f"the paths are: {', '.join(paths)}"
                )

    def _advance(self) -> None:
        """Inject the faults that are due after a tick.

        Raises:
            Fault: The timeout has expired; later calls do not raise it again, so that the arm can brake.
        """
        self._update_occurrences()
        if self.station.driver.clock.now > self._timeout:
            timeout = self._timeout
            self._timeout = math.inf
            raise Fault(f"the mission has not ended after {timeout:g} s on its clock")

    def _update_occurrences(self) -> None:
        """Begin and end the faults with a time span, and run the actions of the active faults."""
        now = self.station.driver.clock.now + TIME_TOLERANCE
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
                if interceptor := occurrence.effect.interceptors.get(access.path):
                    proceed = partial(interceptor, proceed, occurrence, *occurrence.effect.arguments)
        result = proceed()
        if access.path == "arm.execute":
            self._motion = (access.arguments[0], self.station.driver.clock.now)
        elif access.path == "arm.stop":
            self._motion = None
        return result


@dataclass(eq=False)
class Occurrence:
    """One occurrence of an effect.

    Attributes:
        effect: The effect.
        context: The injector.
        node: Path of the node during which the effect occurs, or "".
        item: Item that the node handles, or "".
        end: Time on the run's clock at which the effect ends [s].
        has_acted: True if the action has changed the cell.
        is_over: True if the effect has ended.
        _last_event_time: Time on the run's clock of the last event [s].
    """

    effect: Effect
    context: FaultInjector
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
        """Return the chosen object, or None if there is no such object."""
        world = self.context.world
        if isinstance(choice, int):
            return next(iter(world.objects[choice - 1 : choice]), None)
        if choice == "held":
            return world.held_object
        if choice == "nearest" or not self.item:
            return world.find_nearest_object(self.context.station.unrecorded_cell.arm.tool_pose.position)
        entries = self.context.station.ledger.list_items()
        summary = next((entry for entry in entries if entry.item == self.item), None)
        if summary is None or summary.state == "placed":
            return None
        if summary.state == "held":
            return world.held_object
        return world.find_nearest_object(summary.position, MAX_ITEM_POSITION_ERROR)

    def emit_event(self, affected: TrueObject | None = None) -> None:
        """Emit a `FaultInjected` event with the affected object; at most one event per control step."""
        now = self.context.station.driver.clock.now
        if self._last_event_time == now:
            return
        self._last_event_time = now
        label = affected.label if affected else ""
        position = round_values(affected.position, 4) if affected else []
        self.context.emit(FaultInjected(self.effect.name, self.node, self.item, label, position))
