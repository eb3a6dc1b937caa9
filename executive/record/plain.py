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

from executive.events import Exact
from executive.geometry import Pose
from executive.messages import Frame

DIGITS = 6
"""Decimal places kept: a micrometre, a microradian, a microsecond."""

LONGEST = 2048
"""Bits of the largest integer that is kept as a number: Python reads and writes no more than 640 digits
for certain."""


def plain(value: Any) -> Any:
    """Return `value` as JSON can hold it: floats to `DIGITS` places, a frame by its number only.

    What JSON does not have (infinities, NaN, integers beyond `LONGEST`) becomes text, and so does the half
    of a surrogate pair that stands in a file name which is not UTF-8: a record stays readable by any parser.
    Only what is `Exact` is taken over as it is.
    """
    return _rule(value.__class__)(value)


@functools.cache
def _rule(kind: type) -> Callable[[Any], Any]:
    """Return what makes values of this type plain; found once per type, for events are told within a tick."""
    if issubclass(kind, Enum):
        return lambda value: plain(value.value)
    if issubclass(kind, str):
        return _text
    if issubclass(kind, int):
        return lambda value: value if value.bit_length() <= LONGEST else hex(value)
    if issubclass(kind, type(None)):
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
        return lambda mapping: {_text(str(key)): plain(value) for key, value in mapping.items()}
    if issubclass(kind, (list, tuple)):
        return lambda values: [plain(value) for value in values]
    if issubclass(kind, (set, frozenset)):
        return lambda values: sorted((plain(value) for value in values), key=repr)
    if issubclass(kind, Exact):
        return lambda exact: exact.value
    if dataclasses.is_dataclass(kind):
        names = [field.name for field in dataclasses.fields(kind)]
        return lambda value: {name: plain(getattr(value, name)) for name in names}
    if issubclass(kind, PurePath):
        return lambda path: _text(str(path))
    # A default repr holds a memory address, which would make equal runs look different.
    return lambda _: kind.__name__


def _text(value: str) -> str:
    if value.isascii():
        return value
    try:
        value.encode()
    except UnicodeEncodeError:
        return value.encode(errors="backslashreplace").decode()
    return value


def _number(value: Any) -> float | str:
    number = float(value)
    if not math.isfinite(number):
        return str(number)
    # Adding zero turns -0.0 into 0.0, which compare equal but print differently.
    return round(number, DIGITS) + 0.0
