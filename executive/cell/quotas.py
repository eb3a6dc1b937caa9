"""Quotas: maximum numbers of objects that a mission puts into the bins."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

CountObjects = Callable[[str, str | None], int]
"""Function that returns the number of objects of a class in a bin; of all classes if the class is None."""


@dataclass(frozen=True)
class Quotas:
    """Maximum numbers of objects in the bins of a cell.

    Attributes:
        limits: Maximum number by bin and class; the class None stands for the objects of all classes.
    """

    limits: Mapping[tuple[str, str | None], int]

    def is_reached(self, bin: str, label: str, count_objects: CountObjects) -> bool:
        """Return True if a bin takes no further object of the class `label`."""
        limits = ((key, self.limits.get((bin, key))) for key in (None, label))
        return any(limit is not None and count_objects(bin, key) >= limit for key, limit in limits)
