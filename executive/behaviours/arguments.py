"""Arguments of the constructors of behaviours, and their values in missions."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from enum import Enum
from types import NoneType, UnionType
from typing import Any, Literal, TypeGuard, Union, cast, get_args, get_origin, get_type_hints

from py_trees.behaviour import Behaviour
from py_trees.ports import PortsMixin

from executive.skill import Param, param

_PLAIN_TYPES = (str, int, float, bool, NoneType, list, tuple, dict, set, frozenset, Any)
"""Types of values in a mission if the declaration has no type arguments: `list`, not `list[int]`."""
_CONTAINERS = {
    list: list, tuple: tuple, dict: dict, set: set, frozenset: frozenset, Sequence: list, Mapping: dict,
}  # fmt: skip
"""Type of the value in missions, by the origin of the declared type: `Sequence[int]` takes a list."""
_MAPPINGS = (dict, Mapping)
"""Origins of the declared types of mappings."""


def list_arguments(behaviour: type[Behaviour]) -> dict[str, Param]:
    """Return the arguments of a constructor by name, with the types and defaults of their declarations.

    The arguments include those of base classes that the constructor accepts as `**kwargs`.
    """
    arguments: dict[str, Param] = {}
    for owner in behaviour.__mro__:
        if "__init__" not in vars(owner) or owner is PortsMixin:
            continue
        constructor = vars(owner)["__init__"]
        _, *parameters = inspect.signature(constructor).parameters.values()
        try:
            hints = get_type_hints(constructor)
        except (AttributeError, NameError, TypeError):
            hints = {}  # A type is imported for type checkers only; every value is accepted.
        for parameter in parameters:
            if parameter.kind in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY):
                default = ... if parameter.default is parameter.empty else parameter.default
                argument = param(default, doc=_find_description(owner, parameter.name))
                argument = replace(argument, name=parameter.name, type=hints.get(parameter.name, Any))
                arguments.setdefault(parameter.name, argument)
        if all(parameter.kind is not parameter.VAR_KEYWORD for parameter in parameters):
            break
    return arguments


def find_mission_type(declared_type: object) -> object:
    """Return the type that a mission uses for a declared type, or None if missions cannot contain the values.

    An enumeration becomes a Literal of the names of its members. A union keeps the types that a mission can
    contain.
    """
    origin, parts = get_origin(declared_type), get_args(declared_type)
    if _is_enumeration(declared_type):
        return cast("Any", Literal)[tuple(declared_type.__members__)]
    if origin in (Union, UnionType):
        parts = tuple(part for part in map(find_mission_type, parts) if part is not None)
        return Union[parts] if parts else None  # noqa: UP007 - the number of types varies
    if origin in _CONTAINERS:
        parts = tuple(part if part is ... else find_mission_type(part) for part in parts)
        return None if None in parts else cast("Any", _CONTAINERS[origin])[parts]
    return declared_type if declared_type in _PLAIN_TYPES or origin is Literal else None


def to_argument(value: object, declared_type: object) -> object:
    """Convert a value from a mission to the declared type: names of enumeration members become members."""
    origin, parts = get_origin(declared_type), get_args(declared_type)
    if _is_enumeration(declared_type) and isinstance(value, str):
        return declared_type.__members__.get(value, value)
    if origin in (Union, UnionType):
        candidates = (to_argument(value, part) for part in parts)
        return next((candidate for candidate in candidates if candidate != value), value)
    if isinstance(value, dict) and origin in _MAPPINGS:
        return {to_argument(key, parts[0]): to_argument(item, parts[1]) for key, item in value.items()}
    if isinstance(value, list | tuple) and origin in _CONTAINERS and origin not in _MAPPINGS:
        has_one_type = len(parts) == 1 or ... in parts
        item_types = [parts[0]] * len(value) if has_one_type else parts
        if len(item_types) == len(value):
            return type(value)(map(to_argument, value, item_types))
    return value


def _is_enumeration(declared_type: object) -> TypeGuard[type[Enum]]:
    return isinstance(declared_type, type) and issubclass(declared_type, Enum)


def _find_description(owner: type, name: str) -> str:
    """Return the description of an argument in the Google-style docstring of its class or constructor."""
    for documented in (owner, vars(owner)["__init__"]):
        pattern = rf"^ *{name}(?: \(.*\))?: (.*(?:\n {{6,}}\S.*)*)"
        if match := re.search(pattern, inspect.getdoc(documented) or "", re.MULTILINE):
            return " ".join(match[1].split())
    return ""
