"""Values of plain YAML scalars by the core schema of YAML 1.2.2; unlike in YAML 1.1, `no` is a string."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

# Spellings of the values in the core schema.
_VALUE_BY_WORD: Mapping[str, bool | float | None] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **dict.fromkeys((".nan", ".NaN", ".NAN"), math.nan),
}
_INTEGER = re.compile(r"[-+]?[0-9]+")
_PREFIXED_INTEGER = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_INFINITE = re.compile(r"[-+]?\.(inf|Inf|INF)")
_MAX_NUMBER_LENGTH = 300
"""Maximum number of characters of a number; a longer scalar is a string."""

ScalarValue = None | bool | int | float | str


def convert_scalar(text: str) -> ScalarValue:
    """Return the value of a plain scalar: None, a boolean, a number, or the text itself."""
    if text in _VALUE_BY_WORD:
        return _VALUE_BY_WORD[text]
    if text[0] not in "+-.0123456789" or len(text) > _MAX_NUMBER_LENGTH:
        return text
    if _INTEGER.fullmatch(text):
        return _convert_large_integer(int(text))
    if _PREFIXED_INTEGER.fullmatch(text):
        return _convert_large_integer(int(text, base=0))
    if _FLOAT.fullmatch(text):
        return float(text)
    return float(text.replace(".", "")) if _INFINITE.fullmatch(text) else text


def _convert_large_integer(number: int) -> int | float:
    """Return an integer of at most 64 bits unchanged, and a larger integer as a float, for JSON readers."""
    # Unlike the conversion of an integer, that of a text returns infinity for numbers that are too large.
    return number if -(2**63) <= number < 2**63 else float(str(number))
