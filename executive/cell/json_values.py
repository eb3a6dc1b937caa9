"""Conversion of values to JSON for records, with rounded numbers and without images."""

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

DIGITS = 6
"""Number of decimal places of floats: a micrometre, a microradian, a microsecond."""

MAX_INTEGER_BITS = 2048
"""Length of the largest integer that is written as a number [bit]: 617 digits; Python reads at least 640."""


def to_json(value: Any) -> Any:
    """Return `value` as JSON: floats rounded to `DIGITS` places; of a frame, number, camera and time.

    Values without a JSON form become text: infinities, NaN, integers beyond `MAX_INTEGER_BITS`, and lone
    surrogates, as in a file name that is not UTF-8. Every JSON parser can read the result.
    """
    return _find_converter(value.__class__)(value)


def to_json_or_type_name(value: Any) -> Any:
    """Return `value` as JSON, or the name of its type if the value cannot be converted.

    Skills set outputs of any type; an output that cannot be converted must not end the run.
    """
    try:
        return to_json(value)
    except Exception:
        return type(value).__name__


def round_values(values: Iterable[float], digits: int) -> list[float]:
    """Return the values rounded to a number of decimal places; -0.0 becomes 0.0."""
    return [round(float(value), digits) + 0.0 for value in values]


def _escape(value: str) -> str:
    return value if value.isascii() else value.encode(errors="backslashreplace").decode()


def _round_number(value: Any) -> float | str:
    number = float(value)
    if not math.isfinite(number):
        return str(number)
    # The addition of zero turns -0.0 into 0.0; both are equal, but print differently.
    return round(number, DIGITS) + 0.0


_CONVERTERS: Sequence[tuple[type | tuple[type, ...], Callable[[Any], Any]]] = (
    (Enum, lambda value: to_json(value.value)),
    (str, _escape),
    (int, lambda value: value if value.bit_length() <= MAX_INTEGER_BITS else hex(value)),
    (type(None), lambda value: value),
    ((float, np.floating), _round_number),
    (np.generic, lambda value: to_json(value.item())),
    (np.ndarray, lambda value: to_json(value.tolist())),
    (Frame, lambda frame: {"frame": frame.id, "camera": frame.camera, "stamp": _round_number(frame.stamp)}),
    (Pose, lambda pose: pose.to_rounded_list(DIGITS)),
    (
        Mapping,
        lambda mapping: {_escape(str(key)): to_json(value) for key, value in mapping.items()},
    ),
    ((list, tuple), lambda values: [to_json(value) for value in values]),
    ((set, frozenset), lambda values: sorted((to_json(value) for value in values), key=repr)),
    (PurePath, lambda path: _escape(str(path))),
)
"""Types, and functions that convert their values to JSON; the first matching type applies."""


@functools.cache
def _find_converter(kind: type) -> Callable[[Any], Any]:
    """Return the conversion for a type; cached, because it is needed in every control step."""
    if converter := next((converter for known, converter in _CONVERTERS if issubclass(kind, known)), None):
        return converter
    if dataclasses.is_dataclass(kind):
        names = [field.name for field in dataclasses.fields(kind)]
        return lambda value: {name: to_json(getattr(value, name)) for name in names}
    # The default `repr` contains a memory address, which differs between equal runs.
    return lambda _: kind.__name__
