"""Access to the world of a fake or simulated cell: true objects, seal of the tool, and collisions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from executive.cell.workcell import Workcell, find_innermost_cell
from executive.cells.fake.cell import FakeCell
from executive.cells.fake.world import FakeObject
from executive.errors import InputError
from executive.geometry import Array


@dataclass(frozen=True, eq=False)
class TrueObject:
    """True state of an object.

    Attributes:
        body: Identity of the object: a body id in a simulated world, a `FakeObject` in a fake world.
        label: Class of the object.
        position: Centre of the object `(3,)` [m].
    """

    body: Any
    label: str
    position: Array


class WorldAccess(Protocol):
    """Access of fault scripts to the true state of the world of a cell; skills have no such access."""

    @property
    def objects(self) -> Sequence[TrueObject]:
        """All loose objects, in the order of their creation."""

    @property
    def held_object(self) -> TrueObject | None:
        """The object at the tool, or None."""

    def remove(self, true_object: TrueObject) -> None:
        """Remove an object from the world; a held object is released first."""

    def move(self, true_object: TrueObject, displacement: tuple[float, float]) -> None:
        """Displace an object by `(x, y)` [m]; a held object is released first."""

    def break_seal(self) -> None:
        """Break the seal of the tool; a held object falls."""

    def simulate_collision(self, message: str) -> None:
        """Simulate a collision: the arm brakes and reports `message` as the cause."""

    def settle(self) -> None:
        """Let the arm and the objects come to rest between two runs."""

    def release_if_held(self, true_object: TrueObject) -> None:
        """Break the seal of the tool if the tool holds this object."""
        if self.held_object is not None and self.held_object.body == true_object.body:
            self.break_seal()


class FakeWorldAccess(WorldAccess):
    """Access to the world of a fake cell."""

    def __init__(self, fake: FakeCell) -> None:
        self._fake = fake

    @property
    def objects(self) -> Sequence[TrueObject]:
        """All loose objects, in the order of their creation."""
        return [_make_true_object(fake_object) for fake_object in self._fake.world.objects]

    @property
    def held_object(self) -> TrueObject | None:
        """The object at the tool, or None."""
        held_object = self._fake.world.held_object
        return None if held_object is None else _make_true_object(held_object)

    def remove(self, true_object: TrueObject) -> None:
        """Remove an object from the world."""
        self.release_if_held(true_object)
        self._fake.world.remove(true_object.body)

    def move(self, true_object: TrueObject, displacement: tuple[float, float]) -> None:
        """Displace an object."""
        self.release_if_held(true_object)
        true_object.body.position[:2] += np.array(displacement)
        true_object.body.rest_positions.append(true_object.body.position.copy())

    def break_seal(self) -> None:
        """Break the seal of the tool."""
        self._fake.tool.break_seal()

    def simulate_collision(self, message: str) -> None:
        """Simulate a collision of the arm; `message` is the reported cause."""
        self._fake.arm.stop_after_collision(message)

    def settle(self) -> None:
        """Write the states of the objects to the log; in a fake world all objects are at rest."""
        self._fake.log_state()


def open_world(workcell: Workcell) -> WorldAccess:
    """Return the access to the world of a fake or a simulated cell.

    Raises:
        InputError: The cell is neither fake nor simulated.
    """
    inner = find_innermost_cell(workcell)
    if isinstance(inner, FakeCell):
        return FakeWorldAccess(inner)
    # Imported here, so that tests on a fake cell do not import the simulator.
    from executive.cells.sim.cell import SimCell
    from executive.testing.faults.sim_world_access import SimWorldAccess

    if isinstance(inner, SimCell):
        return SimWorldAccess(inner)
    raise InputError(
        f"faults cannot change the world of a {type(inner).__name__}; "
        "pass a function `open_world` to `with_faults` that returns a WorldAccess for this cell"
    )


def _make_true_object(fake_object: FakeObject) -> TrueObject:
    return TrueObject(fake_object, fake_object.label, fake_object.position.copy())
