"""Whether two values are the same to the last field, arrays and objects of any class included."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np


def same(one: Any, other: Any) -> bool:
    """Tell whether two values are of one type and equal, part by part; NaN is the same as NaN."""
    return _same(one, other, set())


def _same(one: Any, other: Any, compared: set[tuple[int, int]]) -> bool:
    if one is other:
        return True
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        nan = bool(np.issubdtype(one.dtype, np.inexact))
        return one.dtype == other.dtype and bool(np.array_equal(one, other, equal_nan=nan))
    if isinstance(one, float):
        return one == other or (math.isnan(one) and math.isnan(other))
    # What is met again while its own parts are compared differs by no more than these.
    pair = id(one), id(other)
    if pair in compared:
        return True
    compared.add(pair)
    if isinstance(one, Mapping):
        return list(one) == list(other) and all(_same(one[key], other[key], compared) for key in one)
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(_same(a, b, compared) for a, b in zip(one, other, strict=True))
    if hasattr(one, "__dict__") and not callable(one):
        return _same(vars(one), vars(other), compared)
    return bool(one == other)
