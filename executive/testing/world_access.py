"""Access to the world of a fake or simulated cell: true objects, seal of the tool, and collisions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from executive.cell.workcell import Workcell, find_innermost_cell
from executive.cells.fake.cell import FakeCell
from executive.errors import InputError
from executive.geometry import Array, Pose

SETTLING_STEPS = 240
"""Number of control steps until arm and displaced objects of a simulated world are at rest; 1 s."""


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


class WorldAccess:
    """Access of tests to the true state of a fake or simulated world; skills have no such access."""

    def __init__(self, workcell: Any) -> None:
        self._workcell = workcell
        self._is_fake = isinstance(workcell, FakeCell)
        self._world = workcell.world if self._is_fake else workcell._world
        self._tool = workcell.cell.tool

    @property
    def objects(self) -> Sequence[TrueObject]:
        """All loose objects, in the order of their creation."""
        bodies = self._world.objects if self._is_fake else self._world.labels
        return [self._describe_object(body) for body in bodies]

    @property
    def held_object(self) -> TrueObject | None:
        """The object at the tool, or None."""
        body = self._world.held_object if self._is_fake else self._tool.held_body
        return None if body is None else self._describe_object(body)

    def remove(self, true_object: TrueObject) -> None:
        """Remove an object from the world; a held object is released first."""
        self._release_if_held(true_object)
        remove = self._world.remove if self._is_fake else self._world.remove_object
        remove(true_object.body)

    def move(self, true_object: TrueObject, displacement: tuple[float, float]) -> None:
        """Displace an object by `(x, y)` [m]; a held object is released first."""
        self._release_if_held(true_object)
        body = true_object.body
        if self._is_fake:
            body.position[:2] += displacement
            body.rest_positions.append(body.position.copy())
        else:
            X_WO = self._world.get_object_pose(body)
            position = X_WO.position + np.array([*displacement, 0.0])
            self._world.place_object(body, Pose(X_WO.rotation, position))

    def break_seal(self) -> None:
        """Break the seal of the tool; a held object falls."""
        self._tool.break_seal()

    def simulate_collision(self, message: str) -> None:
        """Simulate a collision: the arm brakes and reports `message` as the cause."""
        self._workcell.cell.arm.stop_after_collision(message)

    def settle(self) -> None:
        """Let the arm and the objects come to rest between two runs."""
        if self._is_fake:
            self._workcell.log_state()
            return
        self._world.is_idle = True
        for _ in range(SETTLING_STEPS):
            self._workcell.advance()
        self._world.is_idle = False

    def _release_if_held(self, true_object: TrueObject) -> None:
        if self.held_object is not None and self.held_object.body == true_object.body:
            self.break_seal()

    def _describe_object(self, body: Any) -> TrueObject:
        if self._is_fake:
            return TrueObject(body, body.label, body.position.copy())
        return TrueObject(body, self._world.labels[body], self._world.get_object_pose(body).position)


def open_world(workcell: Workcell) -> WorldAccess:
    """Return the access to the world of a fake or a simulated cell.

    Raises:
        InputError: The cell is neither fake nor simulated.
    """
    inner = find_innermost_cell(workcell)
    if not isinstance(inner, FakeCell):
        # Imported here, because the import of the simulator takes more than a second.
        from executive.cells.sim.cell import SimCell

        if not isinstance(inner, SimCell):
            kind = type(inner).__name__
            raise InputError(f"tests can change only fake and simulated worlds, not that of a {kind}")
    return WorldAccess(inner)
