"""Descriptions of values and of validation errors, for the messages of findings."""

from __future__ import annotations

import re
from collections.abc import Sequence

from pydantic_core import ErrorDetails

from executive.mission.findings import suggest_word

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
"""Description of the expected type, by the type of pydantic's error."""
_BOUND_PHRASES = {
    "greater_than": ("more than", "gt"),
    "greater_than_equal": ("at least", "ge"),
    "less_than": ("less than", "lt"),
    "less_than_equal": ("at most", "le"),
}
"""Comparison in words, and key of the bound in `ErrorDetails.ctx`, by the type of pydantic's error."""


def describe_value(value: object) -> str:
    """Return a description of a plain value, for the end of a sentence: `a list of length 2`."""
    if value is None:
        return "nothing"
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, int):
        return str(value).lower()  # Booleans are integers, too.
    if isinstance(value, str):
        return f'the text "{value}"'
    if isinstance(value, Sequence):
        return f"a list of length {len(value)}"
    return "a mapping"


def describe_validation_error(error: ErrorDetails) -> str:
    """Return the message of a pydantic error, without the name of the value: `must be at least 1, not 0`."""
    error_type, value, context = error["type"], error["input"], error.get("ctx", {})
    if error_type in _TYPE_PHRASES:
        return f"must be {_TYPE_PHRASES[error_type]}, not {describe_value(value)}"
    if error_type in _BOUND_PHRASES:
        comparison, key = _BOUND_PHRASES[error_type]
        return f"must be {comparison} {context[key]:g}, not {describe_value(value)}"
    if error_type == "literal_error":
        expected = context["expected"]
        # Pydantic lists the allowed words in single quotes.
        suggestion = suggest_word(value, re.findall("'([^']*)'", expected))
        choices = expected.replace("'", '"')
        return f"must be {choices}, not {describe_value(value)}{suggestion}"
    if error_type == "too_short":
        return f"has {context['actual_length']} entries, but needs at least {context['min_length']}"
    if error_type == "too_long":
        return f"has {len(value)} entries, but may have at most {context['max_length']}"
    if error_type == "value_error":
        return str(context["error"])
    return f"is not allowed here: {error['msg'][:1].lower()}{error['msg'][1:]}"
