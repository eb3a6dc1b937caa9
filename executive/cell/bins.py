"""Bin with its drop positions (slots), and quotas: maximum numbers of objects in the bins."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

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


Quotas: TypeAlias = Mapping[tuple[str, str | None], int]
"""Maximum number of objects by bin and class; the class None stands for the objects of all classes."""


def is_quota_reached(
    quotas: Quotas, bin: str, label: str, count_objects: Callable[[str, str | None], int]
) -> bool:
    """Return True if a bin takes no further object of the class `label`.

    `count_objects` returns the number of objects of a class in a bin; of all classes if the class is None.
    """
    limits = ((key, quotas.get((bin, key))) for key in (None, label))
    return any(limit is not None and count_objects(bin, key) >= limit for key, limit in limits)
