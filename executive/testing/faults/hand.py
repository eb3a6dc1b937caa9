"""Access to the world of a cell past the robot: its true objects, and brute force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from executive.cell.cell_wrapper import innermost
from executive.cell.workcell import Workcell
from executive.cells.fake.cell import FakeCell
from executive.cells.fake.world import FakeObject
from executive.errors import InputError
from executive.geometry import Array


@dataclass(frozen=True, eq=False)
class Thing:
    """An object as it lies, hangs or falls now.

    Attributes:
        body: Identity of the object in its world.
        label: Its class.
        position: Its centre `(3,)` [m].
    """

    body: Any
    label: str
    position: Array


class Hand(Protocol):
    """Does to the world of a cell what no skill can."""

    @property
    def things(self) -> Sequence[Thing]:
        """Every loose object, in the order they came into the world."""

    @property
    def held(self) -> Thing | None:
        """The object that hangs at the tool, or None."""

    def remove(self, thing: Thing) -> None:
        """Take an object out of the world, out of the tool too."""

    def move(self, thing: Thing, by: tuple[float, float]) -> None:
        """Put an object elsewhere, `by` `(x, y)` [m], out of the tool too; it is at rest there."""

    def part(self) -> None:
        """Let the seal of the tool give way; the object that hangs there falls."""

    def stand_in_the_way(self, what: str) -> None:
        """Let the arm run into `what` now: it breaks off its motion."""

    def settle(self) -> None:
        """Let time pass that is none of a run's: the arm and the objects come to rest."""


class FakeHand:
    """Access to a fake cell; implements `Hand`."""

    def __init__(self, fake: FakeCell) -> None:
        self._fake = fake

    @property
    def things(self) -> Sequence[Thing]:
        """Every object."""
        return [_thing(one) for one in self._fake.world.objects]

    @property
    def held(self) -> Thing | None:
        """The object that hangs at the tool, or None."""
        held = self._fake.world.held
        return None if held is None else _thing(held)

    def remove(self, thing: Thing) -> None:
        """Take an object out of the world."""
        self._loosen(thing)
        self._fake.world.remove(thing.body)

    def move(self, thing: Thing, by: tuple[float, float]) -> None:
        """Put an object elsewhere."""
        self._loosen(thing)
        thing.body.position[:2] += np.array(by)
        thing.body.stood.append(thing.body.position.copy())

    def part(self) -> None:
        """Let the seal give way."""
        self._fake.tool.part()

    def stand_in_the_way(self, what: str) -> None:
        """Let the arm run into something."""
        self._fake.arm.run_into(what)

    def settle(self) -> None:
        """Have the log say what is there: nothing in a fake world moves by itself."""
        self._fake.note()

    def _loosen(self, thing: Thing) -> None:
        if self._fake.world.held is thing.body:
            self.part()


def hand_of(workcell: Workcell) -> Hand:
    """Return the access to the world of a fake or a simulated cell.

    Raises:
        InputError: It is neither.
    """
    inner = innermost(workcell)
    if isinstance(inner, FakeCell):
        return FakeHand(inner)
    # These bring the simulator along, which a fake cell never needs.
    from executive.cells.sim.cell import SimCell
    from executive.testing.faults.sim_hand import SimHand

    if isinstance(inner, SimCell):
        return SimHand(inner)
    raise InputError(
        f"nobody knows how to reach into a {type(inner).__name__}; give `with_faults` a `hand` that does"
    )


def _thing(one: FakeObject) -> Thing:
    return Thing(one, one.label, one.position.copy())
