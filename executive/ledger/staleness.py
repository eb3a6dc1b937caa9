"""Staleness of positions: changes of the table by the robot, which may have moved objects."""

from __future__ import annotations

import math

import numpy as np

from executive.geometry import Array
from executive.ledger.item import Record


class Staleness:
    """Changes of the table, in the order of time, each with the area in which it may have moved objects."""

    def __init__(self) -> None:
        self._changes: list[tuple[Array, float]] = []

    @property
    def epoch(self) -> int:
        """Number of changes so far."""
        return len(self._changes)

    def record_change(self, centre: Array, radius: float) -> None:
        """Record that all objects within `radius` [m] (infinite: the whole table) may have been moved."""
        self._changes.append((centre, radius))

    def is_settled(self, record: Record) -> bool:
        """Return True if nothing may have moved an item since its last detection."""
        return self.is_unchanged(record.position, record.epoch)

    def is_unchanged(self, position: Array, epoch: int) -> bool:
        """Return True if no change after `epoch` may have moved an object at `position` `(3,)` [m]."""
        return self.find_change(position, epoch) is None

    def find_change(self, position: Array, epoch: int) -> int | None:
        """Return the number of the first change after `epoch` that may have moved an object, or None."""
        for number, (centre, radius) in enumerate(self._changes[epoch:], epoch + 1):
            if float(np.linalg.norm(centre[:2] - position[:2])) <= radius:
                return number
        return None

    def is_table_unchanged(self, epoch: int) -> bool:
        """Return True if no change after `epoch` may have moved all objects."""
        return all(math.isfinite(radius) for _, radius in self._changes[epoch:])
