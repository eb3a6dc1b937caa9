"""Reaching into the fake cell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from executive.testing.disturbances.hand import Thing
from executive.testing.fake_cell import FakeCell
from executive.testing.fake_world import FakeObject


class FakeHand:
    """Reaches into a fake cell; implements `Hand`."""

    def __init__(self, fake: FakeCell) -> None:
        self._fake = fake

    @property
    def things(self) -> Sequence[Thing]:
        """Every object."""
        return [_thing(one) for one in self._fake.world.objects]

    @property
    def held(self) -> Thing | None:
        """What hangs at the tool, or None."""
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

    def leak(self, leaks: bool) -> None:
        """Keep the tool from sealing anything, or no longer."""
        self._fake.tool.leaks = leaks

    def stick(self, sticks: bool) -> None:
        """Keep the tool from letting go, or no longer."""
        self._fake.tool.sticks = sticks

    def stand_in_the_way(self, what: str) -> None:
        """Let the arm run into something."""
        self._fake.arm.run_into(what)

    def settle(self) -> None:
        """Have the log say what is there: nothing in a fake world moves by itself."""
        self._fake.note()

    def _loosen(self, thing: Thing) -> None:
        if self._fake.world.held is thing.body:
            self.part()


def _thing(one: FakeObject) -> Thing:
    return Thing(one, one.label, one.position.copy())
