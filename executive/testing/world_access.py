"""Access to the world of a fake or simulated cell: true objects, seal of the tool, and collisions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from executive.cell.workcell import Workcell, find_innermost_cell
from executive.cells.fake import FakeCell
from executive.errors import InputError
from executive.geometry import Array, Pose


class TrueObject(NamedTuple):
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
    """Access of tests to the true state of a fake or simulated world; skills have no such access.

    Attributes:
        cell: The parts of the fake or simulated cell, whose arm and tool have methods for tests.
        world: The `FakeWorld` or the simulated `World` of the cell.

    Raises:
        InputError: The cell is neither fake nor simulated.
    """

    def __init__(self, workcell: Workcell) -> None:
        inner: Any = find_innermost_cell(workcell)
        self.cell = inner.cell
        self._is_fake = isinstance(inner, FakeCell)
        self.world: Any = getattr(inner, "world" if self._is_fake else "_world", None)
        if self.world is None:
            raise InputError(f"tests can change only fake and simulated worlds, not a {type(inner).__name__}")

    @property
    def objects(self) -> Sequence[TrueObject]:
        """All loose objects, in the order of their creation."""
        bodies = self.world.objects if self._is_fake else self.world.labels
        return [self._describe_object(body) for body in bodies]

    @property
    def held_object(self) -> TrueObject | None:
        """The object at the tool, or None."""
        body = self.world.held_object if self._is_fake else self.cell.tool.held_body
        return None if body is None else self._describe_object(body)

    def remove(self, true_object: TrueObject) -> None:
        """Remove an object from the world; a held object is released first."""
        self._release_if_held(true_object)
        remove = self.world.remove if self._is_fake else self.world.remove_object
        remove(true_object.body)

    def move(self, true_object: TrueObject, displacement: tuple[float, float]) -> None:
        """Displace an object by `(x, y)` [m]; a held object is released first."""
        self._release_if_held(true_object)
        body = true_object.body
        if self._is_fake:
            body.position[:2] += displacement
            body.rest_positions.append(body.position.copy())
        else:
            X_WO = self.world.get_object_pose(body)
            position = X_WO.position + np.array([*displacement, 0.0])
            self.world.place_object(body, Pose(X_WO.rotation, position))

    def _release_if_held(self, true_object: TrueObject) -> None:
        if self.held_object is not None and self.held_object.body == true_object.body:
            self.cell.tool.break_seal()

    def _describe_object(self, body: Any) -> TrueObject:
        if self._is_fake:
            return TrueObject(body, body.label, body.position.copy())
        return TrueObject(body, self.world.labels[body], self.world.get_object_pose(body).position)
