"""Conversion of values in missions to the types that skills and control nodes declare."""

from __future__ import annotations

import functools
import json
import math
from typing import cast

from pydantic import TypeAdapter, ValidationError

from executive.behaviours.arguments import find_mission_type
from executive.mission.descriptions import describe_validation_error, describe_value
from executive.mission.findings import suggest_word
from executive.mission.model.port_types import is_assignable
from executive.skill import Param, Port
from executive.tree.keys import Key


class ValueProblem(Exception):
    """A value does not fit its declaration; the message is the end of a sentence: `must be a list`.

    Attributes:
        code: Code of the finding.
    """

    def __init__(self, message: str, code: str = "wrong-type") -> None:
        super().__init__(message)
        self.code = code


def is_plain_type(declared_type: object) -> bool:
    """Return True if values of this type can be written in a mission file."""
    return find_mission_type(declared_type) == declared_type


def find_problem(value: object, declaration: Param | Port) -> ValueProblem | None:
    """Return the error if a param or an input does not accept a constant, else None."""
    try:
        convert_setting(value, declaration)
    except ValueProblem as problem:
        return problem
    return None


def convert_setting(value: object, declaration: Param | Port) -> object:
    """Return a constant converted to the type of a param or an input.

    Raises:
        ValueProblem: The value has another type, is out of bounds, or is none of the choices.
    """
    if isinstance(declaration, Port):
        if value is None and is_assignable(type(None), declaration.type):
            return None
        # Items are created during a run, so a file cannot contain an item.
        if not is_plain_type(declaration.type) or declaration.refers_to == "item":
            example = f"for example ${declaration.name}"
            raise ValueProblem(f"must be a variable, {example}, not {describe_value(value)}")
        return convert_value(value, declaration.type)
    converted = convert_value(value, declaration.type)
    minimum, maximum, choices = declaration.ge, declaration.le, declaration.choices
    unit = f" {declaration.unit}" if declaration.unit else ""
    number = converted if isinstance(converted, int | float) else None
    if number is not None and minimum is not None and number < minimum:
        raise ValueProblem(f"must be at least {minimum:g}{unit}, not {describe_value(value)}", "out-of-range")
    if number is not None and maximum is not None and number > maximum:
        raise ValueProblem(f"must be at most {maximum:g}{unit}, not {describe_value(value)}", "out-of-range")
    # For names of the cell, `choices` contains additional values, which `find_unknown_names` checks.
    if choices is not None and not declaration.refers_to and converted not in choices:
        allowed = " or ".join(f'"{choice}"' if isinstance(choice, str) else str(choice) for choice in choices)
        suggestion = suggest_word(value, map(str, choices))
        raise ValueProblem(f"must be {allowed}, not {describe_value(value)}{suggestion}", "wrong-value")
    return converted


def convert_value(value: object, declared_type: object) -> object:
    """Return a plain value converted to the declared type, for example a list to a tuple.

    Raises:
        ValueProblem: The value cannot be converted.
    """
    if not is_plain_type(declared_type):
        raise ValueProblem(f"must be a variable, not {describe_value(value)}")
    return _validate(_get_adapter(declared_type), value)


def convert_constant(key: Key, value: object, max_value: int | None = None) -> object:
    """Return a plain value converted to the type of a key; a number must not exceed `max_value`.

    Raises:
        ValueProblem: The value cannot be converted, or is out of bounds.
    """
    return _validate(key.make_validator(max_value), value)


def _validate(adapter: TypeAdapter[object], value: object) -> object:
    """Return the converted value, or raise ValueProblem."""
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueProblem(f"must be a finite number, not {value}")
    try:
        return adapter.validate_json(json.dumps(value), strict=True)
    except ValidationError as error:
        # A union has one error per type. The most useful error is a violated bound, such as `less_than`.
        errors = sorted(error.errors(include_url=False), key=lambda details: "than" not in details["type"])
        code = "out-of-range" if "than" in errors[0]["type"] else "wrong-type"
        is_integer_allowed = {details["type"] for details in errors[1:]} == {"int_type"}
        note = " (a whole number is allowed, too)" if is_integer_allowed else ""
        raise ValueProblem(describe_validation_error(errors[0]) + note, code) from None


@functools.lru_cache(maxsize=256)
def _get_adapter(declared_type: object) -> TypeAdapter[object]:
    return TypeAdapter(cast("type[object]", declared_type))
