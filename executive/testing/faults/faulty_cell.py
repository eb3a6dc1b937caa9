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
from executive.testing.faults.effect import Effect, Occasion
from executive.testing.faults.hand import Hand, hand_of
from executive.testing.faults.scene import FaultScene
from executive.testing.faults.script import DuringNode, DuringTime, ScheduledFault

TIME_TOLERANCE = 1e-9
"""Rounding allowed when two times on the clock are compared [s]."""
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

    The cell must `hear` the events of its run, which tell it the running nodes. For each fault it emits a
    `FaultInjected`.

    Args:
        inner: The cell without faults.
        faults: The faults and their times.
        emit: Emits events of the run.
        hand: Returns the access to the world of a cell.
        longest: Time on the run's clock after which the run ends as a fault [s].
    """

    def __init__(
        self,
        inner: Workcell,
        faults: Sequence[ScheduledFault],
        emit: Emit = ignore,
        hand: Callable[[Workcell], Hand] = hand_of,
        longest: float = math.inf,
    ) -> None:
        super().__init__(inner)
        self._scene = FaultScene(inner, hand, emit)
        self._longest = longest
        self._by_node = [(one.what, one.when) for one in faults if isinstance(one.when, DuringNode)]
        self._to_come = [(one.what, one.when) for one in faults if isinstance(one.when, DuringTime)]
        self._activations: Counter[int] = Counter()
        self._occasions: list[Occasion] = []
        self._cell = intercept(inner.cell, self._answer, _ROLES)

    @property
    def cell(self) -> Cell:
        """The cell that skills see."""
        return self._cell

    @property
    def hand(self) -> Hand:
        """Access to the world of the cell."""
        return self._scene.hand

    def hear(self, timed: TimedEvent) -> None:
        """Begin and end the faults of a node: an observer of the run that drives this cell."""
        match timed.event:
            case NodeStarted(node, _, item):
                for number, (effect, when) in enumerate(self._by_node):
                    if when.fits(node):
                        self._activations[number] += 1
                        if when.chosen(self._activations[number]):
                            self._begin(effect, node, item)
            case NodeEnded(node):
                self._end(lambda occasion: occasion.node == node)

    def require_nodes(self, paths: Sequence[str]) -> None:
        """Check that every fault of a node fits one of these `paths`.

        Raises:
            InputError: A fault fits no path.
        """
        for effect, when in self._by_node:
            if not any(map(when.fits, paths)):
                raise InputError(
                    f'{effect.name} waits for a node that is called "{when.pattern}"; '
                    f"there are: {', '.join(paths)}"
                )

    def advance(self) -> None:
        """Let one control step pass, and inject the faults that are due.

        Raises:
            Fault: The run has lasted too long; raised once, so that the arm can brake afterwards.
        """
        self.inner.advance()
        self._step()
        if self._scene.now > self._longest:
            longest, self._longest = self._longest, math.inf
            raise Fault(f"the mission is not done after {longest:g} s on its clock")

    def _step(self) -> None:
        """Begin and end the faults of a time, and let the lasting ones act."""
        now = self._scene.now + TIME_TOLERANCE
        due = [(effect, when) for effect, when in self._to_come if when.start <= now]
        self._to_come = [(effect, when) for effect, when in self._to_come if when.start > now]
        for effect, when in due:
            self._begin(effect, until=when.end)
        self._end(lambda occasion: occasion.until <= now)
        for occasion in self._occasions:
            occasion.act()

    def _begin(self, effect: Effect, node: str = "", item: str = "", until: float = math.inf) -> None:
        self._occasions.append(Occasion(effect, self._scene, node, item, until))
        self._occasions[-1].act()

    def _end(self, ends: Callable[[Occasion], bool]) -> None:
        for occasion in [one for one in self._occasions if ends(one)]:
            occasion.over = True
            self._occasions.remove(occasion)

    def _answer(self, access: Access) -> Any:
        """Return the answer of the cell, changed by all lasting effects."""
        proceed = access.proceed
        if access.name in _ANSWERS:
            self._step()
            for occasion in self._occasions:
                if answer := occasion.effect.answers.get(access.member):
                    proceed = partial(answer, proceed, occasion, *occasion.effect.arguments)
        result = proceed()
        if access.name == "arm.start":
            self._scene.motion = self._scene.now, access.all_arguments[0]
        elif access.name == "arm.stop":
            self._scene.motion = None
        return result


def with_faults(
    kind: Callable[..., Workcell],
    faults: Sequence[ScheduledFault],
    hand: Callable[[Workcell], Hand] = hand_of,
    longest: float = math.inf,
) -> Callable[..., FaultyCell]:
    """Return a kind of cell, for `RunOptions.kind`: another kind, with a fault script.

    The run must be observed by its cell: `run.observe(run.workcell.hear)`.

    Args:
        kind: The other kind.
        faults: The script.
        hand: Returns the access to the world of a cell of that kind.
        longest: Time on the run's clock after which the run ends as a fault [s].
    """

    def make(*args: Any, emit: Emit = ignore, **options: Any) -> FaultyCell:
        return FaultyCell(kind(*args, emit=emit, **options), faults, emit, hand, longest)

    return make
