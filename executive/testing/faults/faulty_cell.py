"""Work cell with injected faults: a wrapper of a cell that executes a fault script."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from executive.cell.proxy import Access, intercept
from executive.cell.workcell import CellWrapper, Workcell
from executive.errors import Fault, InputError
from executive.events import Emit, NodeEnded, NodeStarted, TimedEvent, discard_event
from executive.testing.faults.effect import TIME_TOLERANCE, FaultContext, Occurrence
from executive.testing.faults.script import NodeActivations, ScheduledFault, TimeSpan
from executive.testing.faults.world_access import WorldAccess, open_world

_INTERCEPTED_ROLES = ("arm", "tool", "camera", "detector", "localizer", "operator")
"""Parts of the cell that effects can change or observe."""
_INTERCEPTED_CALLS = {
    "arm.plan", "tool.close", "tool.open", "camera.sees_table", "camera.capture", "detector.request",
    "localizer.localize", "operator.ask",
}  # fmt: skip
"""Calls whose results effects can change."""


class FaultyCell(CellWrapper):
    """A work cell with injected faults; implements `Workcell`.

    Faults of nodes occur only if `on_event` observes the events of the run. Each fault emits `FaultInjected`.

    Args:
        inner: The cell without faults.
        faults: Fault script.
        emit: Function that emits events of the run.
        open_world: Function that returns the access to the world of a cell.
        timeout: Time on the run's clock after which the run ends as a fault [s].
    """

    def __init__(
        self,
        inner: Workcell,
        faults: Sequence[ScheduledFault],
        emit: Emit = discard_event,
        open_world: Callable[[Workcell], WorldAccess] = open_world,
        timeout: float = math.inf,
    ) -> None:
        super().__init__(inner)
        self._context = FaultContext(inner, open_world, emit)
        self._timeout = timeout
        self._node_faults = [(effect, time) for effect, time in faults if isinstance(time, NodeActivations)]
        self._time_faults = [(effect, time) for effect, time in faults if isinstance(time, TimeSpan)]
        self._activation_counts: Counter[int] = Counter()
        self._occurrences: list[Occurrence] = []
        self.cell = intercept(inner.cell, self._intercept_access, _INTERCEPTED_ROLES)

    @property
    def world(self) -> WorldAccess:
        """Access to the world of the cell."""
        return self._context.world

    def on_event(self, timed: TimedEvent) -> None:
        """Begin or end the faults of a node; must be called with each event of the run on this cell."""
        match timed.event:
            case NodeStarted(node, _, item):
                for index, (effect, time) in enumerate(self._node_faults):
                    if time.matches(node):
                        # Each fault counts the activations of all nodes that match its pattern.
                        self._activation_counts[index] += 1
                        if time.includes(self._activation_counts[index]):
                            self._begin_occurrence(Occurrence(effect, self._context, node, item))
            case NodeEnded(node):
                self._end_occurrences(lambda occurrence: occurrence.node == node)

    def check_patterns(self, paths: Sequence[str]) -> None:
        """Check that the pattern of each fault matches at least one of these `paths` of nodes.

        Raises:
            InputError: A pattern matches no path.
        """
        for effect, time in self._node_faults:
            if not any(map(time.matches, paths)):
                raise InputError(
                    f'the pattern "{time.pattern}" of {effect.name} matches no path of a node; '
                    f"the paths are: {', '.join(paths)}"
                )

    def advance(self) -> None:
        """Advance the cell by one control step, and inject the faults that are due.

        Raises:
            Fault: The timeout has expired; later calls do not raise it again, so that the arm can brake.
        """
        self.inner.advance()
        self._update_occurrences()
        if self._context.now > self._timeout:
            timeout, self._timeout = self._timeout, math.inf
            raise Fault(f"the mission has not ended after {timeout:g} s on its clock")

    def _update_occurrences(self) -> None:
        """Begin and end the faults with a time span, and run the actions of the active faults."""
        now = self._context.now + TIME_TOLERANCE
        due_faults = [(effect, time) for effect, time in self._time_faults if time.start <= now]
        self._time_faults = [(effect, time) for effect, time in self._time_faults if time.start > now]
        for effect, time in due_faults:
            self._begin_occurrence(Occurrence(effect, self._context, end=time.end))
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
        if access.name in _INTERCEPTED_CALLS:
            self._update_occurrences()
            for occurrence in self._occurrences:
                if interceptor := occurrence.effect.interceptors.get(access.member):
                    proceed = partial(interceptor, proceed, occurrence, *occurrence.effect.arguments)
        result = proceed()
        if access.name == "arm.start":
            self._context.motion = access.all_arguments[0], self._context.now
        elif access.name == "arm.stop":
            self._context.motion = None
        return result


def with_faults(
    make_cell: Callable[..., Workcell],
    faults: Sequence[ScheduledFault],
    open_world: Callable[[Workcell], WorldAccess] = open_world,
    timeout: float = math.inf,
) -> Callable[..., FaultyCell]:
    """Return a function that makes cells with a fault script, for `RunOptions.make_cell`.

    The cell must observe the run: `run.add_observer(run.workcell.on_event)`.

    Args:
        make_cell: Function that makes the cells without faults.
        faults: Fault script.
        open_world: Function that returns the access to the world of these cells.
        timeout: Time on the run's clock after which the run ends as a fault [s].
    """

    def make_faulty_cell(*args: Any, emit: Emit = discard_event, **options: Any) -> FaultyCell:
        return FaultyCell(make_cell(*args, emit=emit, **options), faults, emit, open_world, timeout)

    return make_faulty_cell
