"""Conversion of values in missions to the types that skills and control nodes declare."""

from __future__ import annotations

import functools
import json
import math
import types
import typing
from typing import Any, Union, cast, get_args, get_origin

from pydantic import TypeAdapter, ValidationError

from executive.mission.descriptions import describe_value, describe_violation
from executive.mission.model.port_types import is_assignable
from executive.skill import Port
from executive.tree.keys import Key

_SCALARS = (str, int, float, bool, type(None), Any)
_CONTAINERS = (tuple, list, dict, frozenset, set)


class WrongType(Exception):
    """A value does not have the declared type; the message follows the name of the value in a sentence.

    Attributes:
        code: Code of the finding.
    """

    def __init__(self, text: str, code: str = "wrong-type") -> None:
        super().__init__(text)
        self.code = code


def is_plain_type(declared: object) -> bool:
    """Return True if values of this type can be written in a mission file."""
    if declared in _SCALARS or declared in _CONTAINERS or declared is Ellipsis:
        return True
    origin = get_origin(declared)
    if origin is typing.Literal:
        return True
    if origin in (Union, types.UnionType) or origin in _CONTAINERS:
        return all(is_plain_type(part) for part in get_args(declared))
    return False


def find_input_problem(value: object, port: Port) -> str:
    """Return why a constant does not fit an input, to follow the name of the input; "" if it fits."""
    if value is None and is_assignable(type(None), port.type):
        return ""
    # Items exist only during a run, so a file cannot name an item.
    if not is_plain_type(port.type) or port.refers == "item":
        return f"must be a variable, for example ${port.name}, not {describe_value(value)}"
    try:
        convert_value(value, port.type)
    except WrongType as problem:
        return str(problem)
    return ""


def convert_value(value: object, declared: object) -> object:
    """Return a plain value converted to the declared type, for example a list to a tuple.

    Raises:
        WrongType: The value cannot be converted.
    """
    if not is_plain_type(declared):
        raise WrongType(f"must be a variable, not {describe_value(value)}")
    return _validate(_get_adapter(declared), value)


def convert_constant(key: Key, value: object, max_value: int | None = None) -> object:
    """Return a plain value converted to the type of a key; `max_value` is the upper bound of numbers.

    Raises:
        WrongType: The value cannot be converted, or is out of bounds.
    """
    return _validate(key.make_validator(max_value), value)


def _validate(adapter: TypeAdapter[object], value: object) -> object:
    if isinstance(value, float) and not math.isfinite(value):
        raise WrongType(f"must be a finite number, not {value}")
    try:
        return adapter.validate_json(json.dumps(value), strict=True)
    except ValidationError as error:
        problems = error.errors(include_url=False)
        # A union of types has one problem per type; a violated bound is the most helpful one.
        main = next((problem for problem in problems if "than" in problem["type"]), problems[0])
        code = "out-of-range" if "than" in main["type"] else "wrong-type"
        other_types = {problem["type"] for problem in problems if problem is not main}
        note = " (a whole number is allowed, too)" if other_types == {"int_type"} else ""
        raise WrongType(describe_violation(main) + note, code) from None


@functools.lru_cache(maxsize=256)
def _get_adapter(declared: object) -> TypeAdapter[object]:
    return TypeAdapter(cast("type[object]", declared))
