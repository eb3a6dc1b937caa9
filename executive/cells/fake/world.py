"""A table without physics: objects are points that are picked, carried and let go."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import numpy as np

from executive.cell.bins import BIN_THICKNESS, Bin
from executive.cell.objects import ObjectClass
from executive.errors import InputError
from executive.geometry import Array
from executive.mission.findings import alternatives

MAX_SEAL_OFFSET = 0.012
"""How far beside an object's centre the fake cup still seals [m]."""

TOUCH_DISTANCE = 0.002
"""How far above or below an object's upper side the fake cup is on it [m]."""


@dataclass(eq=False)
class FakeObject:
    """One object on the fake table.

    Attributes:
        label: Its class.
        position: Its centre `(3,)` [m].
        stood: Where that was in the beginning, and wherever the object fell or was put since `(3,)` [m].
        fell: Whether it fell from the tool, and was not in it again.
    """

    label: str
    position: Array
    stood: list[Array]
    fell: bool = False


@dataclass(eq=False)
class FakeWorld:
    """Everything on the fake table.

    Attributes:
        classes: What objects there may be.
        objects: The objects, in the order they were put down.
        removed: Those that somebody took away.
        bins: What objects may lie in.
        held: The object at the tool, or None.
        is_commanded: True if arm or tool was commanded in this control step.
    """

    classes: Mapping[str, ObjectClass]
    objects: list[FakeObject] = field(default_factory=list)
    removed: list[FakeObject] = field(default_factory=list)
    bins: Collection[Bin] = ()
    held: FakeObject | None = None
    is_commanded: bool = False

    def put(self, label: str, x: float, y: float) -> FakeObject:
        """Stand an object on the table and return it.

        Args:
            label: Its class.
            x: Where its centre is [m].
            y: Where its centre is [m].

        Raises:
            InputError: The cell knows no such class.
        """
        if label not in self.classes:
            raise InputError(
                f'nothing of the class "{label}" can be put on the fake table. '
                f"{alternatives(label, self.classes, 'The cell file has the classes')}"
            )
        position = np.array([x, y, self.classes[label].height / 2])
        added = FakeObject(label, position, [position.copy()])
        self.objects.append(added)
        return added

    def remove(self, thing: FakeObject) -> None:
        """Take an object away that is not held."""
        self.objects.remove(thing)
        self.removed.append(thing)

    def roll_off(self, thing: FakeObject) -> None:
        """Move a fallen object from the wall of a bin into that bin, or off other objects on the table.

        It is moved off each of the other objects once. An object inside a bin stays where it is.
        """
        if self._fall_into_bin(thing):
            return
        radius = self.classes[thing.label].radius
        for other in self.objects:
            apart = radius + self.classes[other.label].radius
            way = thing.position[:2] - other.position[:2]
            distance = float(np.linalg.norm(way))
            if other is not thing and distance < apart:
                way = way / distance if distance else np.array((1.0, 0.0))
                thing.position[:2] = other.position[:2] + apart * way
        self._fall_into_bin(thing)

    def _fall_into_bin(self, thing: FakeObject) -> bool:
        """Move an object from the wall of a bin into the bin; return True if it is in a bin then."""
        radius = self.classes[thing.label].radius
        if any(bin.contains(thing.position) for bin in self.bins):
            return True
        for bin in self.bins:
            if bin.contains(thing.position, BIN_THICKNESS + radius / 2):
                inside = np.maximum(bin.size[:2] / 2 - radius, 0.0)
                offset = thing.position[:2] - bin.position[:2]
                thing.position[:2] = bin.position[:2] + np.clip(offset, -inside, inside)
                return True
        return False

    def top(self, thing: FakeObject) -> float:
        """Return the height of an object's upper side [m]."""
        return float(thing.position[2]) + self.classes[thing.label].height / 2

    def under(self, tip: Array) -> FakeObject | None:
        """Return the object whose upper side the cup at `tip` `(3,)` [m] is on, if any."""
        for thing in self.objects:
            beside = float(np.linalg.norm(thing.position[:2] - tip[:2]))
            off = abs(beside - self.classes[thing.label].ring)
            near = off <= MAX_SEAL_OFFSET and abs(self.top(thing) - tip[2]) <= TOUCH_DISTANCE
            if near and thing is not self.held:
                return thing
        return None
