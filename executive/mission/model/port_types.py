"""Types of ports: which fit each other, and what they are called."""

from __future__ import annotations

import types
from collections.abc import Sequence
from typing import Any, NoReturn, Union, get_args, get_origin

_WORDS = {
    str: "a text",
    int: "a whole number",
    float: "a number",
    bool: "true or false",
    type(None): "nothing",
}


def is_assignable(given: object, wanted: object) -> bool:
    """Tell whether every value of the type `given` is one of the type `wanted`."""
    if given is Any or wanted is Any or given == wanted or given is NoReturn:
        return True
    if _is_union(given):
        return all(is_assignable(part, wanted) for part in get_args(given))
    if _is_union(wanted):
        return any(is_assignable(given, part) for part in get_args(wanted))
    if given is int and wanted is float:
        return True
    if not issubclass(_class_of(given), _class_of(wanted)):
        return False
    inner = zip(get_args(given), get_args(wanted), strict=False)
    return all(is_assignable(one, other) for one, other in inner if ... not in (one, other))


def find_element_type(listed: object) -> object:
    """Return the type of the elements of a list type, or None where it is no list."""
    if listed is Any:
        return Any
    if not issubclass(_class_of(listed), Sequence) or _class_of(listed) is str:
        return None
    arguments = [argument for argument in get_args(listed) if argument is not ...]
    return Union[tuple(arguments)] if arguments else Any  # noqa: UP007 - made of as many as there are


def describe_type(declared: object) -> str:
    """Return what values of a type are called in a sentence."""
    if declared in _WORDS:
        return _WORDS[declared]
    if _is_union(declared):
        return " or ".join(describe_type(part) for part in get_args(declared))
    element = find_element_type(declared)
    if element is not None and declared is not object:
        return "a list" if element is Any else f"a list of {describe_type(element).removeprefix('a ')}"
    return getattr(declared, "__name__", str(declared))


def _is_union(declared: object) -> bool:
    return get_origin(declared) in (Union, types.UnionType)


def _class_of(declared: object) -> type:
    origin = get_origin(declared) or declared
    return origin if isinstance(origin, type) else object
