"""Access to the world of a cell without the robot: true objects, the seal, and obstacles."""

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
class TrueObject:
    """True state of an object.

    Attributes:
        body: Identity of the object in its world.
        label: Class of the object.
        position: Centre of the object `(3,)` [m].
    """

    body: Any
    label: str
    position: Array


class WorldAccess(Protocol):
    """Changes the world of a cell in ways that no skill can."""

    @property
    def objects(self) -> Sequence[TrueObject]:
        """All loose objects, in the order of their creation."""

    @property
    def held(self) -> TrueObject | None:
        """The object at the tool, or None."""

    def remove(self, removed: TrueObject) -> None:
        """Remove an object from the world, and from the tool if it is held."""

    def move(self, moved: TrueObject, by: tuple[float, float]) -> None:
        """Displace an object by `(x, y)` [m], out of the tool if it is held; it is at rest afterwards."""

    def break_seal(self) -> None:
        """Break the seal of the tool; a held object falls."""

    def block_arm(self, message: str) -> None:
        """Let the arm run into an obstacle; it brakes, and reports `message`."""

    def settle(self) -> None:
        """Let the arm and the objects come to rest, in time that does not belong to a run."""

    def drop(self, held: TrueObject) -> None:
        """Break the seal if the tool holds this object."""
        if self.held is not None and self.held.body == held.body:
            self.break_seal()


class FakeWorldAccess(WorldAccess):
    """Access to the world of a fake cell."""

    def __init__(self, fake: FakeCell) -> None:
        self._fake = fake

    @property
    def objects(self) -> Sequence[TrueObject]:
        """All objects."""
        return [_describe(fake_object) for fake_object in self._fake.world.objects]

    @property
    def held(self) -> TrueObject | None:
        """The object at the tool, or None."""
        held = self._fake.world.held
        return None if held is None else _describe(held)

    def remove(self, removed: TrueObject) -> None:
        """Remove an object from the world."""
        self.drop(removed)
        self._fake.world.remove(removed.body)

    def move(self, moved: TrueObject, by: tuple[float, float]) -> None:
        """Displace an object."""
        self.drop(moved)
        moved.body.position[:2] += np.array(by)
        moved.body.rest_positions.append(moved.body.position.copy())

    def break_seal(self) -> None:
        """Break the seal of the tool."""
        self._fake.tool.break_seal()

    def block_arm(self, message: str) -> None:
        """Let the arm run into an obstacle."""
        self._fake.arm.run_into(message)

    def settle(self) -> None:
        """Write the objects into the log; nothing moves by itself in a fake world."""
        self._fake.log_state()


def open_world(workcell: Workcell) -> WorldAccess:
    """Return the access to the world of a fake or a simulated cell.

    Raises:
        InputError: The cell is neither fake nor simulated.
    """
    inner = innermost(workcell)
    if isinstance(inner, FakeCell):
        return FakeWorldAccess(inner)
    # A fake cell must not import the simulator.
    from executive.cells.sim.cell import SimCell
    from executive.testing.faults.sim_world_access import SimWorldAccess

    if isinstance(inner, SimCell):
        return SimWorldAccess(inner)
    raise InputError(
        f"faults cannot change the world of a {type(inner).__name__}; "
        "give `with_faults` an `open_world` that returns a WorldAccess for it"
    )


def _describe(fake_object: FakeObject) -> TrueObject:
    return TrueObject(fake_object, fake_object.label, fake_object.position.copy())
