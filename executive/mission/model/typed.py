"""Values of a mission as the types that skills declare."""

from __future__ import annotations

import functools
import json
import math
import types
import typing
from typing import Any, Union, cast, get_args, get_origin

from pydantic import TypeAdapter, ValidationError

from executive.mission.model.port_types import is_assignable
from executive.mission.words import describe, violation
from executive.skill import Port
from executive.tree.keys import Key

_SCALARS = (str, int, float, bool, type(None), Any)
_CONTAINERS = (tuple, list, dict, frozenset, set)


class WrongType(Exception):
    """A value is not of the declared type; the text follows the value's name in a sentence.

    Attributes:
        code: Code of the finding.
    """

    def __init__(self, text: str, code: str = "wrong-type") -> None:
        super().__init__(text)
        self.code = code


def is_plain(declared: object) -> bool:
    """Tell whether values of this type can be written in a mission file."""
    if declared in _SCALARS or declared in _CONTAINERS or declared is Ellipsis:
        return True
    origin = get_origin(declared)
    if origin is typing.Literal:
        return True
    if origin in (Union, types.UnionType) or origin in _CONTAINERS:
        return all(is_plain(part) for part in get_args(declared))
    return False


def find_input_problem(value: object, port: Port) -> str:
    """Return what is wrong with a value in a mission file for an input, to follow its name, or ""."""
    if value is None and is_assignable(type(None), port.type):
        return ""
    # Items exist only in a run: no file can name one.
    if not is_plain(port.type) or port.refers == "item":
        return f"takes a variable, written ${port.name}, not {describe(value)}"
    try:
        convert(value, port.type)
    except WrongType as problem:
        return str(problem)
    return ""


def convert(value: object, declared: object) -> object:
    """Return a plain value as the declared type: lists become tuples, whole numbers floats.

    Raises:
        WrongType: The value does not fit.
    """
    if not is_plain(declared):
        raise WrongType(f"takes a variable, not {describe(value)}")
    return _read(_adapter(declared), value)


def read_constant(key: Key, value: object, max_value: int | None = None) -> object:
    """Return a plain value as a constant of a control node; numbers are at most `max_value`.

    Raises:
        WrongType: The value does not fit, or is out of bounds.
    """
    return _read(key.make_validator(max_value), value)


def _read(adapter: TypeAdapter[object], value: object) -> object:
    if isinstance(value, float) and not math.isfinite(value):
        raise WrongType(f"must be a finite number, not {value}")
    try:
        return adapter.validate_json(json.dumps(value), strict=True)
    except ValidationError as problems:
        found = problems.errors(include_url=False)
        # A number beyond a bound may also be no member of the alternatives.
        first = next((one for one in found if "than" in one["type"]), found[0])
        code = "out-of-range" if "than" in first["type"] else "wrong-type"
        others = {one["type"] for one in found if one is not first}
        also = " (a whole number is allowed, too)" if others == {"int_type"} else ""
        raise WrongType(violation(first) + also, code) from None


@functools.lru_cache(maxsize=256)
def _adapter(declared: object) -> TypeAdapter[object]:
    return TypeAdapter(cast("type[object]", declared))
