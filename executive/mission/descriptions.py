"""Descriptions of values and of pydantic's errors, for the messages of findings."""

from __future__ import annotations

import re
from collections.abc import Sequence

from pydantic_core import ErrorDetails

from executive.mission.findings import find_similar_word

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
_BOOLEAN_BY_WORD = {"yes": "true", "on": "true", "no": "false", "off": "false"}
_QUANTITY = re.compile(r"[-+]?[0-9.]+ *[A-Za-z]+")
"""Number with a unit."""
_BOUND_PHRASES = {
    "greater_than": ("more than", "gt"),
    "greater_than_equal": ("at least", "ge"),
    "less_than": ("less than", "lt"),
    "less_than_equal": ("at most", "le"),
}
"""Comparison in words, and key of the bound in the error's context, by the type of pydantic's error."""


def describe_value(value: object) -> str:
    """Return a description of a plain value, for the end of a sentence: `a list of length 2`."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return f"{value:g}" if isinstance(value, float) else str(value)
    if isinstance(value, str):
        return f'the text "{value}"'
    if isinstance(value, Sequence):
        return f"a list of length {len(value)}"
    return "a mapping"


def describe_violation(problem: ErrorDetails) -> str:
    """Return the message of a pydantic error, without the name of the value: `must be at least 1, not 0`."""
    error_type, value = problem["type"], problem["input"]
    context = problem.get("ctx", {})
    if error_type in _TYPE_PHRASES:
        correction = _suggest_correction(error_type, value)
        return f"must be {_TYPE_PHRASES[error_type]}, not {describe_value(value)}{correction}"
    if error_type in _BOUND_PHRASES:
        comparison, key = _BOUND_PHRASES[error_type]
        return f"must be {comparison} {context[key]:g}, not {describe_value(value)}"
    if error_type == "literal_error":
        expected = context["expected"]
        similar = find_similar_word(value, _list_quoted_words(expected)) if isinstance(value, str) else None
        question = f' (did you mean "{similar}"?)' if similar else ""
        return f"must be {expected.replace(chr(39), chr(34))}, not {describe_value(value)}{question}"
    if error_type == "too_short":
        return f"has {context['actual_length']} entries, but needs at least {context['min_length']}"
    if error_type == "too_long":
        return f"has {len(value)} entries, but may have at most {context['max_length']}"
    if error_type == "value_error":
        return str(context["error"])
    return f"is not allowed here: {problem['msg'][:1].lower()}{problem['msg'][1:]}"


def _suggest_correction(error_type: str, value: object) -> str:
    """Return a suggested correction in brackets, or ""."""
    if error_type == "bool_type" and isinstance(value, str) and value.lower() in _BOOLEAN_BY_WORD:
        return f" (write {_BOOLEAN_BY_WORD[value.lower()]})"
    if error_type in ("float_type", "int_type") and isinstance(value, str) and _QUANTITY.fullmatch(value):
        return " (write the number without its unit)"
    return ""


def _list_quoted_words(expected: str) -> list[str]:
    """Return the words in single quotes in pydantic's list of expected values."""
    return expected.split("'")[1::2]
