"""Descriptions of values and of pydantic's errors for findings."""

from __future__ import annotations

import re
from collections.abc import Sequence

from pydantic_core import ErrorDetails

from executive.mission.findings import suggest

_TYPE_PHRASES = {
    "string_type": "a text",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "bool_type": "true or false",
    "list_type": "a list",
    "tuple_type": "a list",
    "set_type": "a list",
    "dict_type": "a mapping",
    "model_type": "a mapping",
    "model_attributes_type": "a mapping",
    "dataclass_type": "a mapping",
    "none_required": "left empty",
}
_BOOLEAN_WORDS = {"yes": "true", "on": "true", "no": "false", "off": "false"}
_WITH_UNIT = re.compile(r"[-+]?[0-9.]+ *[A-Za-z]+")
_BOUNDS = {
    "greater_than": ("more than", "gt"),
    "greater_than_equal": ("at least", "ge"),
    "less_than": ("less than", "lt"),
    "less_than_equal": ("at most", "le"),
}


def describe(value: object) -> str:
    """Return a description of a plain value, for the end of a sentence."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return f"{value:g}" if isinstance(value, float) else str(value)
    if isinstance(value, str):
        return f'the text "{value}"'
    if isinstance(value, Sequence):
        return f"a list of {len(value)}"
    return "a mapping"


def violation(problem: ErrorDetails) -> str:
    """Return the message of an error of pydantic, without the name of the value."""
    kind, given = problem["type"], problem["input"]
    context = problem.get("ctx", {})
    if kind in _TYPE_PHRASES:
        return f"must be {_TYPE_PHRASES[kind]}, not {describe(given)}{_suggest_correction(kind, given)}"
    if kind in _BOUNDS:
        words, key = _BOUNDS[kind]
        return f"must be {words} {context[key]:g}, not {describe(given)}"
    if kind == "literal_error":
        meant = suggest(given, _find_quoted(context["expected"])) if isinstance(given, str) else None
        question = f' (did you mean "{meant}"?)' if meant else ""
        return f"must be {context['expected'].replace(chr(39), chr(34))}, not {describe(given)}{question}"
    if kind == "too_short":
        return f"needs at least {context['min_length']}, has {context['actual_length']}"
    if kind == "too_long":
        return f"takes at most {context['max_length']}, has {len(given)}"
    if kind == "value_error":
        return str(context["error"])
    return f"is not allowed here: {problem['msg'][:1].lower()}{problem['msg'][1:]}"


def _suggest_correction(kind: str, given: object) -> str:
    """Return a suggested correction in brackets, or ""."""
    if kind == "bool_type" and isinstance(given, str) and given.lower() in _BOOLEAN_WORDS:
        return f" (write {_BOOLEAN_WORDS[given.lower()]})"
    if kind in ("float_type", "int_type") and isinstance(given, str) and _WITH_UNIT.fullmatch(given):
        return " (write the number without its unit)"
    return ""


def _find_quoted(expected: str) -> list[str]:
    return expected.split("'")[1::2]
