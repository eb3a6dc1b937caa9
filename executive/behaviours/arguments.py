"""Arguments of the constructors of behaviours, and their values in missions."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from types import NoneType, UnionType
from typing import Any, Literal, Union, cast, get_args, get_origin, get_type_hints

from py_trees.behaviour import Behaviour
from py_trees.ports import PortsMixin

_PLAIN_TYPES = (str, int, float, bool, NoneType, list, tuple, dict, Any)
"""Types without type arguments whose values a mission may contain."""
_CONTAINERS = {list: list, tuple: tuple, dict: dict, Sequence: list, Mapping: dict}
"""Type of the values in a mission, for types with type arguments."""


@dataclass(frozen=True)
class ConstructorArgument:
    """An argument of the constructor of a behaviour.

    Attributes:
        hint: Declared type.
        default: Default value; `...` for a required argument.
        doc: Description in the docstring of the behaviour, or "".
    """

    hint: object
    default: object
    doc: str


def list_arguments(behaviour: type[Behaviour]) -> dict[str, ConstructorArgument]:
    """Return the arguments of the constructor by name, also those that it passes on as `**kwargs`."""
    arguments: dict[str, ConstructorArgument] = {}
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
                hint = hints.get(parameter.name, Any)
                argument = ConstructorArgument(hint, default, _find_description(owner, parameter.name))
                arguments.setdefault(parameter.name, argument)
        if all(parameter.kind is not parameter.VAR_KEYWORD for parameter in parameters):
            break
    return arguments


def find_mission_type(hint: object) -> object:
    """Return the type of the values that a mission gives for a declared type; None if there is none.

    Missions name the members of an enumeration. A union keeps the types that a mission can contain.
    """
    origin, parts = get_origin(hint), get_args(hint)
    if isinstance(hint, type) and issubclass(hint, Enum):
        return cast("Any", Literal)[tuple(hint.__members__)]
    if origin in (Union, UnionType):
        parts = tuple(part for part in map(find_mission_type, parts) if part is not None)
        return Union[parts] if parts else None  # noqa: UP007 - the number of types varies
    if origin in _CONTAINERS:
        parts = tuple(part if part is ... else find_mission_type(part) for part in parts)
        return None if None in parts else cast("Any", _CONTAINERS[origin])[parts]
    return hint if hint in _PLAIN_TYPES or origin is Literal else None


def to_argument(value: object, hint: object) -> object:
    """Return a value of a mission as a value of the declared type: the members of enumerations by name."""
    if isinstance(hint, type) and issubclass(hint, Enum):
        return hint.__members__.get(value, value) if isinstance(value, str) else value
    for part in get_args(hint):
        if isinstance(value, list | tuple) and get_origin(hint) in _CONTAINERS:
            return type(value)(to_argument(item, part) for item in value)
        if get_origin(hint) in (Union, UnionType) and (converted := to_argument(value, part)) is not value:
            return converted
    return value


def _find_description(owner: type, name: str) -> str:
    """Return the description of an argument in the Google-style docstring of its class or constructor."""
    for documented in (owner, vars(owner)["__init__"]):
        pattern = rf"^ *{name}(?: \(.*\))?: (.*(?:\n {{6,}}\S.*)*)"
        if match := re.search(pattern, inspect.getdoc(documented) or "", re.MULTILINE):
            return " ".join(match[1].split())
    return ""
