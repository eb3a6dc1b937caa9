"""Conversion of Python values to JSON values with rounded numbers and without images."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from enum import Enum
from pathlib import PurePath
from typing import Any

import numpy as np

from executive.cell.frame import Frame
from executive.geometry import Pose

DECIMAL_PLACES = 6
"""Number of decimal places of floats; the last is a micrometre, a microradian or a microsecond."""

MAX_INTEGER_BITS = 2048
"""Maximum size of an integer that is written as a number [bit]: 617 digits; Python always reads 640."""


def to_json(value: Any) -> Any:
    """Return `value` converted to types that `json.dumps` accepts and every JSON parser can read.

    Floats are rounded to `DECIMAL_PLACES`. A frame is converted without its image. Infinities, NaN and
    integers beyond `MAX_INTEGER_BITS` become text. A dataclass with `omits_none` is converted without the
    fields that are None. Lone surrogates are escaped, as UTF-8 cannot encode them.
    """
    return _find_converter(value.__class__)(value)


def to_json_or_type_name(value: Any) -> Any:
    """Return the result of `to_json`, or the name of the type if the value cannot be converted.

    A skill output can have any type, and an output without a conversion must not end the run.
    """
    try:
        return to_json(value)
    except Exception:
        return type(value).__name__


def round_values(values: Iterable[float], digits: int) -> list[float]:
    """Return the values rounded to a number of decimal places; -0.0 becomes 0.0."""
    return [round(float(value), digits) + 0.0 for value in values]


def _escape_surrogates(text: str) -> str:
    """Return a text in which lone surrogates, which UTF-8 cannot encode, are escaped."""
    return text if text.isascii() else text.encode(errors="backslashreplace").decode()


def _round_number(value: Any) -> float | str:
    """Return a rounded number, or the text of an infinity or NaN."""
    number = float(value)
    if not math.isfinite(number):
        return str(number)
    # The addition of zero turns -0.0 into 0.0, so that equal numbers have the same text.
    return round(number, DECIMAL_PLACES) + 0.0


_CONVERTERS: Sequence[tuple[type | tuple[type, ...], Callable[[Any], Any]]] = (
    (Enum, lambda value: to_json(value.value)),
    (str, _escape_surrogates),
    (int, lambda value: value if value.bit_length() <= MAX_INTEGER_BITS else hex(value)),
    (type(None), lambda value: value),
    ((float, np.floating), _round_number),
    (np.generic, lambda value: to_json(value.item())),
    (np.ndarray, lambda value: to_json(value.tolist())),
    (Frame, lambda frame: {"frame": frame.id, "camera": frame.camera, "stamp": _round_number(frame.stamp)}),
    (Pose, lambda pose: pose.to_rounded_list(DECIMAL_PLACES)),
    (Mapping, lambda mapping: {_escape_surrogates(str(key)): to_json(item) for key, item in mapping.items()}),
    ((list, tuple), lambda values: [to_json(value) for value in values]),
    ((set, frozenset), lambda values: sorted((to_json(value) for value in values), key=repr)),
    (PurePath, lambda path: _escape_surrogates(str(path))),
)
"""Types and the converters of their values to JSON; the first matching type applies."""


@functools.cache
def _find_converter(value_type: type) -> Callable[[Any], Any]:
    """Return the converter of a type; cached, because every control step converts values."""
    for types, converter in _CONVERTERS:
        if issubclass(value_type, types):
            return converter
    if dataclasses.is_dataclass(value_type):
        names = [field.name for field in dataclasses.fields(value_type)]
        if getattr(value_type, "omits_none", False):
            return lambda value: {
                name: to_json(item) for name in names if (item := getattr(value, name)) is not None
            }
        return lambda value: {name: to_json(getattr(value, name)) for name in names}
    # The default `repr` contains a memory address, which differs between equal runs.
    return lambda _: value_type.__name__
