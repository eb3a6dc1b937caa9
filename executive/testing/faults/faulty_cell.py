"""Work cell into which the faults of a script are injected."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from executive.cell.cell_wrapper import CellWrapper
from executive.cell.protocols import Cell
from executive.cell.proxy import Access, intercept
from executive.cell.workcell import Workcell
from executive.errors import Fault, InputError
from executive.events import Emit, NodeEnded, NodeStarted, TimedEvent, ignore
from executive.testing.faults.effect import TIME_TOLERANCE, FaultScene, Occurrence
from executive.testing.faults.script import DuringNode, DuringTime, ScheduledFault
from executive.testing.faults.world_access import WorldAccess, open_world

_ROLES = ("arm", "tool", "camera", "detector", "localizer", "operator")
_ANSWERS = frozenset(
    {
        "arm.plan", "tool.close", "tool.open", "camera.sees_table", "camera.capture", "detector.request",
        "localizer.localize", "operator.ask",
    }
)  # fmt: skip
"""Accesses whose answers effects can change."""


class FaultyCell(CellWrapper):
    """A work cell with injected faults; implements `Workcell`.

    The cell must `hear` the events of its run to know the running nodes. Each fault emits a `FaultInjected`.

    Args:
        inner: The cell without faults.
        faults: The faults and their times.
        emit: Emits events of the run.
        open_world: Returns the access to the world of a cell.
        timeout: Time on the run's clock after which the run ends as a fault [s].
    """

    def __init__(
        self,
        inner: Workcell,
        faults: Sequence[ScheduledFault],
        emit: Emit = ignore,
        open_world: Callable[[Workcell], WorldAccess] = open_world,
        timeout: float = math.inf,
    ) -> None:
        super().__init__(inner)
        self._scene = FaultScene(inner, open_world, emit)
        self._timeout = timeout
        self._node_faults = [
            (fault.effect, fault.time) for fault in faults if isinstance(fault.time, DuringNode)
        ]
        self._pending = [(fault.effect, fault.time) for fault in faults if isinstance(fault.time, DuringTime)]
        self._activations: Counter[int] = Counter()
        self._occurrences: list[Occurrence] = []
        self._cell = intercept(inner.cell, self._answer, _ROLES)

    @property
    def cell(self) -> Cell:
        """The cell that skills see."""
        return self._cell

    @property
    def world(self) -> WorldAccess:
        """Access to the world of the cell."""
        return self._scene.world

    def hear(self, timed: TimedEvent) -> None:
        """Begin and end the faults of a node; an observer of the run on this cell."""
        match timed.event:
            case NodeStarted(node, _, item):
                for index, (effect, time) in enumerate(self._node_faults):
                    if time.matches(node):
                        self._activations[index] += 1
                        if time.includes(self._activations[index]):
                            self._begin(Occurrence(effect, self._scene, node, item))
            case NodeEnded(node):
                self._end(lambda occurrence: occurrence.node == node)

    def require_nodes(self, paths: Sequence[str]) -> None:
        """Check that the pattern of each fault matches one of these `paths`.

        Raises:
            InputError: A pattern matches no path.
        """
        for effect, time in self._node_faults:
            if not any(map(time.matches, paths)):
                raise InputError(
                    f'no path of a node matches "{time.pattern}", the pattern of {effect.name}; '
                    f"the paths are: {', '.join(paths)}"
                )

    def advance(self) -> None:
        """Let one control step pass, and inject the faults that are due.

        Raises:
            Fault: The timeout has expired; raised once, so that the arm can brake afterwards.
        """
        self.inner.advance()
        self._step()
        if self._scene.now > self._timeout:
            timeout, self._timeout = self._timeout, math.inf
            raise Fault(f"the mission is not done after {timeout:g} s on its clock")

    def _step(self) -> None:
        """Begin and end the faults with a time, and let the active ones act."""
        now = self._scene.now + TIME_TOLERANCE
        due = [(effect, time) for effect, time in self._pending if time.start <= now]
        self._pending = [(effect, time) for effect, time in self._pending if time.start > now]
        for effect, time in due:
            self._begin(Occurrence(effect, self._scene, end=time.end))
        self._end(lambda occurrence: occurrence.end <= now)
        for occurrence in self._occurrences:
            occurrence.act()

    def _begin(self, occurrence: Occurrence) -> None:
        self._occurrences.append(occurrence)
        occurrence.act()

    def _end(self, is_ending: Callable[[Occurrence], bool]) -> None:
        for occurrence in filter(is_ending, list(self._occurrences)):
            occurrence.is_over = True
            self._occurrences.remove(occurrence)

    def _answer(self, access: Access) -> Any:
        """Return the answer of the cell, changed by all active effects."""
        proceed = access.proceed
        if access.name in _ANSWERS:
            self._step()
            for occurrence in self._occurrences:
                if answer := occurrence.effect.answers.get(access.member):
                    proceed = partial(answer, proceed, occurrence, *occurrence.effect.arguments)
        result = proceed()
        if access.name == "arm.start":
            self._scene.motion = self._scene.now, access.all_arguments[0]
        elif access.name == "arm.stop":
            self._scene.motion = None
        return result


def with_faults(
    kind: Callable[..., Workcell],
    faults: Sequence[ScheduledFault],
    open_world: Callable[[Workcell], WorldAccess] = open_world,
    timeout: float = math.inf,
) -> Callable[..., FaultyCell]:
    """Return a kind of cell with a fault script, for `RunOptions.kind`.

    The cell must observe the run: `run.add_observer(run.workcell.hear)`.

    Args:
        kind: The kind of cell without faults.
        faults: The script.
        open_world: Returns the access to the world of a cell of that kind.
        timeout: Time on the run's clock after which the run ends as a fault [s].
    """

    def make(*args: Any, emit: Emit = ignore, **options: Any) -> FaultyCell:
        return FaultyCell(kind(*args, emit=emit, **options), faults, emit, open_world, timeout)

    return make
