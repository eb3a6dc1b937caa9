"""A work cell in which a fault script happens."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from executive.cell.cell_wrapper import CellWrapper
from executive.cell.protocols import Cell
from executive.cell.proxy import Access, intercept
from executive.cell.workcell import Workcell
from executive.errors import InputError
from executive.events import Emit, TimedEvent, ignore
from executive.testing.faults.hand import Hand, hand_of
from executive.testing.faults.scene import Scene
from executive.testing.faults.schedule import Schedule
from executive.testing.faults.script import Disturbance, DuringNode

_DISTURBED = frozenset(
    {
        "arm.plan", "tool.close", "tool.open", "camera.sees_table", "camera.capture", "detector.request",
        "localizer.localize", "operator.ask",
    }
)  # fmt: skip
"""Accesses that go through the schedule; the method of an effect has the name of the member."""


class DisturbedCell(CellWrapper):
    """A work cell to which things happen, physically; implements `Workcell`.

    Whoever runs a mission in it lets it `hear` the run's events: it knows by them which node runs. Whenever
    it does something to the cell, it emits a `disturbance`.

    Args:
        inner: The cell as it would be.
        disturbances: What happens to it, and when.
        emit: Tells the run what happens.
        hand: Returns what reaches into a cell's world.
    """

    def __init__(
        self,
        inner: Workcell,
        disturbances: Sequence[Disturbance],
        emit: Emit = ignore,
        hand: Callable[[Workcell], Hand] = hand_of,
    ) -> None:
        super().__init__(inner)
        self._disturbances = tuple(disturbances)
        self._scene = Scene(inner, hand, emit)
        self._schedule = Schedule(self._disturbances, self._scene)
        self._cell = self._between_skills_and(inner.cell)

    @property
    def cell(self) -> Cell:
        """What skills see."""
        return self._cell

    @property
    def hand(self) -> Hand:
        """What reaches into its world."""
        return self._scene.hand

    def hear(self, timed: TimedEvent) -> None:
        """Observe the run that drives this cell."""
        self._schedule.hear(timed)

    def require_nodes(self, paths: Sequence[str]) -> None:
        """Return if every disturbance that waits for a node may find one among these `paths`.

        Raises:
            InputError: One fits none of them.
        """
        for one in self._disturbances:
            if isinstance(one.when, DuringNode) and not any(map(one.when.fits, paths)):
                raise InputError(
                    f'{one.what.name} waits for a node that is called "{one.when.pattern}"; '
                    f"there are: {', '.join(paths)}"
                )

    def advance(self) -> None:
        """Let one control step pass, and what is due happen."""
        self.inner.advance()
        self._schedule.step()

    def _between_skills_and(self, cell: Cell) -> Cell:
        """Return the cell with everything that can be disturbed going through the schedule."""

        def ask(access: Access) -> Any:
            if access.name in _DISTURBED:
                return self._schedule.through(access.member, access.proceed)
            answer = access.proceed()
            if access.name == "arm.start":
                self._scene.started(*access.all_arguments)
            elif access.name == "arm.stop":
                self._scene.stopped()
            return answer

        return intercept(cell, ask, ("arm", "tool", "camera", "detector", "localizer", "operator"))


def disturbed(
    kind: Callable[..., Workcell],
    disturbances: Sequence[Disturbance],
    hand: Callable[[Workcell], Hand] = hand_of,
) -> Callable[..., DisturbedCell]:
    """Return a kind of cell, for `RunOptions.kind`: another kind, with a fault script.

    The run must be observed by its cell: `run.observe(run.workcell.hear)`, or `run.record(...)` where it
    plays an earlier one first.

    Args:
        kind: The other kind.
        disturbances: The script.
        hand: Returns what reaches into the world of a cell of that kind.
    """

    def make(*args: Any, emit: Emit = ignore, **options: Any) -> DisturbedCell:
        return DisturbedCell(kind(*args, emit=emit, **options), disturbances, emit, hand)

    return make
