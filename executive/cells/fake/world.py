"""World without physics: a table with objects that the tool can pick, transport and release."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import numpy as np

from executive.cell.bins import BIN_THICKNESS, Bin
from executive.cell.objects import ObjectClass
from executive.errors import InputError
from executive.geometry import Array
from executive.mission.findings import list_choices

MAX_SEAL_OFFSET = 0.012
"""Maximum horizontal distance between the cup and the sealing ring of an object for a seal [m]."""

TOUCH_DISTANCE = 0.002
"""Maximum vertical distance between the cup and the top of an object for contact [m]."""


@dataclass(eq=False)
class FakeObject:
    """One object of a fake world.

    Attributes:
        label: Class of the object.
        position: Centre of the object `(3,)` [m].
        rest_positions: Positions `(3,)` [m] at the start, and after each fall and each placement.
        is_dropped: True if the object fell from the tool and has not been picked up since.
    """

    label: str
    position: Array
    rest_positions: list[Array]
    is_dropped: bool = False


@dataclass(eq=False)
class FakeWorld:
    """Objects and bins of a fake cell.

    Attributes:
        classes: Classes of the objects, by label.
        objects: The objects, in the order in which they were added.
        removed_objects: The removed objects.
        bins: The bins of the cell.
        held: The object that the tool holds, or None.
        is_commanded: True if arm or tool received a command in this control step.
    """

    classes: Mapping[str, ObjectClass]
    objects: list[FakeObject] = field(default_factory=list)
    removed_objects: list[FakeObject] = field(default_factory=list)
    bins: Collection[Bin] = ()
    held: FakeObject | None = None
    is_commanded: bool = False

    def put(self, label: str, x: float, y: float) -> FakeObject:
        """Put a new object on the table and return the object.

        Args:
            label: Class of the object.
            x: Position of the centre along x [m].
            y: Position of the centre along y [m].

        Raises:
            InputError: The cell has no such class.
        """
        if label not in self.classes:
            raise InputError(
                f'no object of the class "{label}" can be put on the fake table. '
                f"{list_choices(label, self.classes, 'The cell file has the classes')}"
            )
        position = np.array([x, y, self.classes[label].height / 2])
        added = FakeObject(label, position, [position.copy()])
        self.objects.append(added)
        return added

    def remove(self, fake_object: FakeObject) -> None:
        """Remove an object that is not held."""
        self.objects.remove(fake_object)
        self.removed_objects.append(fake_object)

    def roll_to_free_position(self, fallen: FakeObject) -> None:
        """Move a fallen object from the wall of a bin into that bin, or off other objects on the table.

        The object is moved once per object that it overlaps. An object inside a bin is not moved.
        """
        if self._move_into_bin(fallen):
            return
        radius = self.classes[fallen.label].radius
        for other in self.objects:
            min_distance = radius + self.classes[other.label].radius
            direction = fallen.position[:2] - other.position[:2]
            distance = float(np.linalg.norm(direction))
            if other is not fallen and distance < min_distance:
                direction = direction / distance if distance else np.array((1.0, 0.0))
                fallen.position[:2] = other.position[:2] + min_distance * direction
        self._move_into_bin(fallen)

    def _move_into_bin(self, fallen: FakeObject) -> bool:
        """Move an object on the wall of a bin into the bin; return True if the object is now in a bin."""
        radius = self.classes[fallen.label].radius
        if any(bin.contains(fallen.position) for bin in self.bins):
            return True
        for bin in self.bins:
            if bin.contains(fallen.position, BIN_THICKNESS + radius / 2):
                max_offset = np.maximum(bin.size[:2] / 2 - radius, 0.0)
                offset = fallen.position[:2] - bin.position[:2]
                fallen.position[:2] = bin.position[:2] + np.clip(offset, -max_offset, max_offset)
                return True
        return False

    def find_touched_object(self, tip: Array) -> FakeObject | None:
        """Return the object whose top a cup at `tip` `(3,)` [m] touches, or None."""
        for fake_object in self.objects:
            distance = float(np.linalg.norm(fake_object.position[:2] - tip[:2]))
            offset = abs(distance - self.classes[fake_object.label].ring)
            top = float(fake_object.position[2]) + self.classes[fake_object.label].height / 2
            is_touched = offset <= MAX_SEAL_OFFSET and abs(top - tip[2]) <= TOUCH_DISTANCE
            if is_touched and fake_object is not self.held:
                return fake_object
        return None
