"""Values as records keep them: plain JSON, numbers rounded, images left out."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
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
    if value is None or isinstance(value, (str, bool, int)):
        return value.value if isinstance(value, Enum) else value
    if isinstance(value, (float, np.floating)):
        return _number(float(value))
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, Frame):
        return {"frame": value.id, "camera": value.camera, "stamp": _number(value.stamp)}
    if isinstance(value, Pose):
        return value.rounded(DIGITS)
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    if isinstance(value, (set, frozenset)):
        return sorted((plain(entry) for entry in value), key=repr)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, Enum):
        return plain(value.value)
    if isinstance(value, PurePath):
        return str(value)
    # A default repr holds a memory address, which would make equal runs look different.
    return type(value).__name__


def _number(value: float) -> float | str:
    if not math.isfinite(value):
        return str(value)
    # Adding zero turns -0.0 into 0.0, which compare equal but print differently.
    return round(value, DIGITS) + 0.0
