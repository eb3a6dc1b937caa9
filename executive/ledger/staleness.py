"""Staleness of positions: record of the actions of the robot that may have moved objects on the table."""

from __future__ import annotations

import math

import numpy as np

from executive.geometry import Array
from executive.ledger.item import ItemRecord


class Staleness:
    """Changes of the table in chronological order, numbered from 1.

    The parameter `change_count` is the number of changes before a look; later changes may have moved objects.
    """

    def __init__(self) -> None:
        self._changes: list[tuple[Array, float]] = []
        """Centre `(3,)` [m] and radius [m] of each change; the radius is infinite for the whole table."""

    @property
    def change_count(self) -> int:
        """Number of changes so far."""
        return len(self._changes)

    def record_change(self, centre: Array, radius: float) -> None:
        """Record that objects within `radius` [m] of `centre` `(3,)` [m] may have been moved."""
        self._changes.append((centre, radius))

    def is_unmoved(self, record: ItemRecord) -> bool:
        """Return True if no change after the last detection of an item may have moved the item."""
        return self.is_unchanged(record.position, record.change_count)

    def is_unchanged(self, position: Array, change_count: int) -> bool:
        """Return True if no change after `change_count` may have moved an object at `position` `(3,)` [m]."""
        return self.find_change_number(position, change_count) is None

    def find_change_number(self, position: Array, change_count: int) -> int | None:
        """Return the number of the first change after `change_count` near `position` `(3,)` [m], or None."""
        for number, (centre, radius) in enumerate(self._changes[change_count:], change_count + 1):
            if float(np.linalg.norm(centre[:2] - position[:2])) <= radius:
                return number
        return None

    def is_table_unchanged(self, change_count: int) -> bool:
        """Return True if no change after `change_count` concerns the whole table."""
        return all(math.isfinite(radius) for _, radius in self._changes[change_count:])
