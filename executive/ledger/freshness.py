"""What the robot's own doing has put in doubt: where a target may no longer be where it was seen."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from executive.geometry import Array


@dataclass(frozen=True, eq=False)
class Change:
    """One change of the table: everything within `radius` [m] of `centre` may have moved."""

    epoch: int
    centre: Array
    radius: float


class Freshness:
    """Counts the robot's changes of the table and remembers where they were."""

    def __init__(self) -> None:
        self._changes: list[Change] = []

    @property
    def epoch(self) -> int:
        """How many changes there were."""
        return len(self._changes)

    def disturb(self, centre: Array, radius: float) -> None:
        """Record that everything within `radius` [m] (infinite: the whole table) may have moved."""
        self._changes.append(Change(self.epoch + 1, centre, radius))

    def holds(self, position: Array, epoch: int) -> bool:
        """Tell whether something seen at `position` when the count was `epoch` is still there for sure."""
        return self.disturbed(position, epoch) is None

    def disturbed(self, position: Array, epoch: int) -> int | None:
        """Return the count at the first change after `epoch` that may have moved what was there, or None."""
        for change in self._changes[epoch:]:
            if float(np.linalg.norm(change.centre[:2] - position[:2])) <= change.radius:
                return change.epoch
        return None

    def anywhere_holds(self, epoch: int) -> bool:
        """Tell whether there is any place that nothing has put in doubt since the count was `epoch`."""
        return all(math.isfinite(change.radius) for change in self._changes[epoch:])
