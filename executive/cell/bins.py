"""Bin with its drop positions (slots)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from executive.geometry import Array

BIN_THICKNESS = 0.005
"""Thickness of a bin's floor and walls [m]."""


@dataclass(frozen=True, eq=False)
class Bin:
    """A container into which objects are sorted.

    Attributes:
        name: Name in the cell file.
        position: Centre of the underside of the floor in the world `(3,)` [m].
        size: Inner length, width and wall height `(3,)` [m].
        slots: Drop positions over the floor `(N, 2)` [m], in the order of their use.
    """

    name: str
    position: Array
    size: Array
    slots: Array

    def contains(self, position: Array, margin: float = 0.0) -> bool:
        """Return True if x and y of `position` `(3,)` [m] are in the floor area, enlarged by `margin` [m]."""
        return bool(np.all(np.abs(position[:2] - self.position[:2]) <= self.size[:2] / 2 + margin))
