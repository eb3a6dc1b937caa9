"""Changes of the table by the robot, and the places that they put in doubt."""

from __future__ import annotations

import math

import numpy as np

from executive.geometry import Array


class Freshness:
    """Counts the robot's changes of the table and remembers where they were."""

    def __init__(self) -> None:
        self._changes: list[tuple[Array, float]] = []

    @property
    def epoch(self) -> int:
        """Number of changes so far."""
        return len(self._changes)

    def disturb(self, centre: Array, radius: float) -> None:
        """Record that everything within `radius` [m] (infinite: the whole table) may have moved."""
        self._changes.append((centre, radius))

    def holds(self, position: Array, epoch: int) -> bool:
        """Return True if something seen at `position` when the count was `epoch` is still there for sure."""
        return self.disturbed(position, epoch) is None

    def disturbed(self, position: Array, epoch: int) -> int | None:
        """Return the count at the first change after `epoch` that may have moved what was there, or None."""
        for count, (centre, radius) in enumerate(self._changes[epoch:], epoch + 1):
            if float(np.linalg.norm(centre[:2] - position[:2])) <= radius:
                return count
        return None

    def anywhere_holds(self, epoch: int) -> bool:
        """Return True if there is any place that no change since the count `epoch` has put in doubt."""
        return all(math.isfinite(radius) for _, radius in self._changes[epoch:])
