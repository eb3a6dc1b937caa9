"""Values as records keep them: plain JSON, numbers rounded, images left out."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Mapping
from enum import Enum
from pathlib import PurePath
from typing import Any

import numpy as np

from executive.geometry import Pose
from executive.messages import Frame

DIGITS = 6
"""Decimal places kept: a micrometre, a microradian, a microsecond."""


def plain(value: Any) -> Any:
    """Return `value` as JSON can hold it: floats to `DIGITS` places, a frame by its number only.

    Numbers that JSON does not have (infinities, NaN) become text, so a record stays readable by any parser.
    """
    return _rule(value.__class__)(value)


@functools.cache
def _rule(kind: type) -> Callable[[Any], Any]:
    """Return what makes values of this type plain; found once per type, for events are told within a tick."""
    if issubclass(kind, Enum):
        return lambda value: plain(value.value)
    if issubclass(kind, (str, int, type(None))):
        return lambda value: value
    if issubclass(kind, (float, np.floating)):
        return _number
    if issubclass(kind, np.generic):
        return lambda value: plain(value.item())
    if issubclass(kind, np.ndarray):
        return lambda value: plain(value.tolist())
    if issubclass(kind, Frame):
        return lambda frame: {"frame": frame.id, "camera": frame.camera, "stamp": _number(frame.stamp)}
    if issubclass(kind, Pose):
        return lambda pose: pose.rounded(DIGITS)
    if issubclass(kind, Mapping):
        return lambda mapping: {str(key): plain(value) for key, value in mapping.items()}
    if issubclass(kind, (list, tuple)):
        return lambda values: [plain(value) for value in values]
    if issubclass(kind, (set, frozenset)):
        return lambda values: sorted((plain(value) for value in values), key=repr)
    if dataclasses.is_dataclass(kind):
        names = [field.name for field in dataclasses.fields(kind)]
        return lambda value: {name: plain(getattr(value, name)) for name in names}
    if issubclass(kind, PurePath):
        return str
    # A default repr holds a memory address, which would make equal runs look different.
    return lambda _: kind.__name__


def _number(value: Any) -> float | str:
    number = float(value)
    if not math.isfinite(number):
        return str(number)
    # Adding zero turns -0.0 into 0.0, which compare equal but print differently.
    return round(number, DIGITS) + 0.0
