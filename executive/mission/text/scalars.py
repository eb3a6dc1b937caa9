"""What a plain YAML scalar means, by the core schema of YAML 1.2.2 (section 10.3.2).

PyYAML follows YAML 1.1, where `no` is false, `1e-3` a text, `12:30` the number 750 and `010` eight.
"""

from __future__ import annotations

import math
import re

_NULL = frozenset({"", "~", "null", "Null", "NULL"})
_TRUE = frozenset({"true", "True", "TRUE"})
_FALSE = frozenset({"false", "False", "FALSE"})
_INTEGER = re.compile(r"[-+]?[0-9]+")
_OCTAL = re.compile(r"0o[0-7]+")
_HEXADECIMAL = re.compile(r"0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_INFINITE = re.compile(r"[-+]?\.(inf|Inf|INF)")
_NAN = frozenset({".nan", ".NaN", ".NAN"})
_MAX_NUMBER_LENGTH = 300

ScalarValue = None | bool | int | float | str


def core_value(text: str) -> ScalarValue:
    """Return the value of a plain scalar: nothing, a truth value, a number, or the text itself."""
    if text in _NULL:
        return None
    if text in _TRUE:
        return True
    if text in _FALSE:
        return False
    if text[0] not in "+-.0123456789" or len(text) > _MAX_NUMBER_LENGTH:
        return text
    if _INTEGER.fullmatch(text):
        return _whole(int(text))
    if _OCTAL.fullmatch(text):
        return _whole(int(text[2:], 8))
    if _HEXADECIMAL.fullmatch(text):
        return _whole(int(text[2:], 16))
    if _FLOAT.fullmatch(text):
        return float(text)
    if _INFINITE.fullmatch(text):
        return float(text.replace(".", ""))
    return float("nan") if text in _NAN else text


def _whole(number: int) -> int | float:
    """Return a whole number that 64 bits hold as it is, a larger one as a float, as JSON readers do."""
    if -(2**63) <= number < 2**63:
        return number
    try:
        return float(number)
    except OverflowError:
        return math.inf if number > 0 else -math.inf
