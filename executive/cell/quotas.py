"""Quotas: maximum numbers of objects that a mission puts into the bins."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeAlias

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
