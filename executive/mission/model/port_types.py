"""Types of ports: assignability, types of list elements and fields, and descriptions for messages."""

from __future__ import annotations

import types
from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from typing import Any, NoReturn, Union, get_args, get_origin, get_type_hints

from executive.cell.objects import KnownItem, RefersTo

_DESCRIPTIONS = {
    str: "a text",
    int: "a whole number",
    float: "a number",
    bool: "true or false",
    type(None): "nothing",
}
"""Description of the values of a type, for messages."""


def is_assignable(source: object, target: object) -> bool:
    """Return True if every value of the type `source` is also a value of the type `target`."""
    if source is Any or target is Any or source == target or source is NoReturn:
        return True
    if is_union(source):
        return all(is_assignable(part, target) for part in get_args(source))
    if is_union(target):
        return any(is_assignable(source, part) for part in get_args(target))
    if source is int and target is float:
        return True
    if not issubclass(_get_class(source), _get_class(target)):
        return False
    arguments = zip(get_args(source), get_args(target), strict=False)
    return all(is_assignable(*pair) for pair in arguments if ... not in pair)


def find_element_type(declared_type: object) -> object:
    """Return the type of the elements of a list or tuple type, or None for other types."""
    if declared_type is Any:
        return Any
    if declared_type is str or not issubclass(_get_class(declared_type), Sequence):
        return None
    arguments = [argument for argument in get_args(declared_type) if argument is not ...]
    return Union[tuple(arguments)] if arguments else Any  # noqa: UP007 - the number of types varies


def find_fields(declared_type: object, refers_to: str) -> dict[str, tuple[object, str]]:
    """Return type and kind of names of each field of the values of a type, by name.

    The kind is "" for a field without names. An item has the fields of `KnownItem`.
    """
    value_type = KnownItem if refers_to == "item" and declared_type is str else declared_type
    if not (isinstance(value_type, type) and is_dataclass(value_type)):
        return {}
    hints, annotations = get_type_hints(value_type), get_type_hints(value_type, include_extras=True)
    return {
        field.name: (hints[field.name], _find_kind(annotations[field.name])) for field in fields(value_type)
    }


def _find_kind(annotation: object) -> str:
    markers = getattr(annotation, "__metadata__", ())
    return next((marker.kind for marker in markers if isinstance(marker, RefersTo)), "")


def describe_type(declared_type: object) -> str:
    """Return a description of the values of a type, for a sentence: `a list of Target`."""
    if declared_type in _DESCRIPTIONS:
        return _DESCRIPTIONS[declared_type]
    if is_union(declared_type):
        return " or ".join(describe_type(part) for part in get_args(declared_type))
    element_type = find_element_type(declared_type)
    if element_type is not None and declared_type is not object:
        if element_type is Any:
            return "a list"
        return f"a list of {describe_type(element_type).removeprefix('a ')}"
    return getattr(declared_type, "__name__", str(declared_type))


def is_union(declared_type: object) -> bool:
    """Return True if a type is a union of types."""
    return get_origin(declared_type) in (Union, types.UnionType)


def _get_class(declared_type: object) -> type:
    """Return the class of a type without type arguments; `object` for a type that is no class."""
    origin = get_origin(declared_type) or declared_type
    return origin if isinstance(origin, type) else object
