"""Comparison of two values part by part, arrays and objects of any class included."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np


def is_same(one: Any, other: Any) -> bool:
    """Return True if two values are of one type and equal, part by part; NaN is the same as NaN."""
    return _is_same(one, other, set())


def _is_same(one: Any, other: Any, compared: set[tuple[int, int]]) -> bool:
    if one is other:
        return True
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        nan = bool(np.issubdtype(one.dtype, np.inexact))
        return one.dtype == other.dtype and bool(np.array_equal(one, other, equal_nan=nan))
    if isinstance(one, float):
        return one == other or (math.isnan(one) and math.isnan(other))
    # A pair that is met again while its own parts are compared differs by no more than these.
    pair = id(one), id(other)
    if pair in compared:
        return True
    compared.add(pair)
    if isinstance(one, Mapping):
        return list(one) == list(other) and all(_is_same(one[key], other[key], compared) for key in one)
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(lambda a, b: _is_same(a, b, compared), one, other))
    if hasattr(one, "__dict__") and not callable(one):
        return _is_same(vars(one), vars(other), compared)
    return bool(one == other)
