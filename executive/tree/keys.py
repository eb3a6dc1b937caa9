"""Declarations of the keys of control nodes, from which parser, schema, checks and builder are derived."""

from __future__ import annotations

import types
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum, auto
from functools import cache
from typing import Annotated, Any, ClassVar, TypeAlias, Union, cast, get_args, get_origin, get_type_hints

from py_trees.behaviour import Behaviour
from pydantic import Field, TypeAdapter

from executive.tree.failure import Reason

Child: TypeAlias = Behaviour
"""Child of a control node; in the checker and the diagnosis, a `StandIn` that represents it."""


class VariableName(str):
    """Name of a variable of the mission."""


Children: TypeAlias = tuple[Child, ...]
Reasons: TypeAlias = tuple[Reason, ...]
Elements: TypeAlias = tuple[object, ...] | VariableName
"""A list from the mission file, or the name of the variable that holds a list."""


class Kind(Enum):
    """Kind of the value of a key, derived from the type annotation of its attribute."""

    NODE = auto()
    NODES = auto()
    REASONS = auto()
    VARIABLE = auto()
    ELEMENTS = auto()
    SECTION = auto()
    SECTIONS = auto()
    CONSTANT = auto()


@dataclass(frozen=True)
class Key:
    """A key of a control node or of a section.

    Attributes:
        doc: Meaning of the key, one sentence.
        default: Value if the key is missing; `...` for a required key.
        ge, gt: Inclusive and exclusive lower bound of a number, or None.
        max_key: For a number: key whose number of nodes is the maximum of the number, or "".
        max_count: For a list of nodes: maximum number of nodes, or None.
        is_shorthand: True if the key may be omitted and its value written directly under the keyword.
        is_sibling: True if the key is written at the level of the keyword, as `catch` beside `try`.
        is_in_path: False if the paths of the nodes under the key do not contain the key.
        raising_key: For a list of reasons: key of the nodes that raise these failures.
        list_key: For a variable: key of the list whose elements the variable holds in turn, or "".
        name: Name of the key in the mission file.
        attribute: Name of the attribute in the class.
        kind: Kind of the value.
        value_type: Type of a constant, or class of a section.
    """

    doc: str
    default: object = ...
    ge: float | None = None
    gt: float | None = None
    max_key: str = ""
    max_count: int | None = None
    is_shorthand: bool = False
    is_sibling: bool = False
    is_in_path: bool = True
    raising_key: str = "do"
    list_key: str = ""
    name: str = ""
    attribute: str = ""
    kind: Kind = Kind.CONSTANT
    value_type: object = None

    @property
    def is_required(self) -> bool:
        """True if the key has no default, so that the mission must give a value."""
        return self.default is ...

    @property
    def section(self) -> type[KeySection]:
        """The class of the section or sections under the key."""
        return cast("type[KeySection]", self.value_type)

    def make_validator(self, max_value: int | None = None) -> TypeAdapter[object]:
        """Return the validator of a constant; `max_value` is the upper bound of a number, or None."""
        return _make_validator(self.value_type, self.ge, self.gt, max_value)


def key(
    *,
    doc: str,
    default: object = ...,
    ge: float | None = None,
    gt: float | None = None,
    max_key: str = "",
    max_count: int | None = None,
    shorthand: bool = False,
    sibling: bool = False,
    in_path: bool = True,
    raising_key: str = "do",
    list_key: str = "",
) -> Any:
    """Return the declaration of a key, to be assigned to an attribute; see `Key` for the arguments.

    The name of the key is the name of the attribute, without a trailing underscore.
    """
    return Key(doc, default, ge, gt, max_key, max_count, shorthand, sibling, in_path, raising_key, list_key)


class KeyOwner:
    """Base of classes that declare keys.

    Attributes:
        keys: Declarations of the keys, by their names in the mission file.
        any_of: Names of keys of which a mission must give at least one; empty for no such rule.
    """

    keys: ClassVar[Mapping[str, Key]] = {}
    any_of: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, **kwargs: object) -> None:
        super().__init_subclass__(**kwargs)
        declared = {name: value for name, value in vars(cls).items() if isinstance(value, Key)}
        hints = get_type_hints(cls, include_extras=True) if declared else {}
        if missing := [name for name in declared if name not in hints]:
            name = f"{cls.__qualname__}.{missing[0]}"
            raise TypeError(f"{name} has no annotation: write its type before `= key(...)`")
        keys = dict(cls.keys)
        for attribute, value in declared.items():
            complete = _complete_declaration(value, attribute, hints[attribute])
            keys[complete.name] = complete
            delattr(cls, attribute)
        cls.keys = keys

    def set_keys(self, values: Mapping[str, object]) -> None:
        """Set the attributes of all keys to `values`, by the names of the attributes, or to their defaults.

        Raises:
            TypeError: A required value is missing, or an attribute in `values` belongs to no key.
        """
        remaining = dict(values)
        for declaration in self.keys.values():
            value = remaining.pop(declaration.attribute, declaration.default)
            if value is ...:
                raise TypeError(f"{type(self).__name__} needs a value for {declaration.attribute}")
            setattr(self, declaration.attribute, tuple(value) if isinstance(value, list) else value)
        if remaining:
            raise TypeError(f"{type(self).__name__} has no key {', '.join(remaining)}")


class KeySection(KeyOwner):
    """Base class of the mappings under a key of a control node; a subclass declares the keys of a mapping."""

    def __init__(self, **values: object) -> None:
        self.set_keys(values)


def _complete_declaration(declaration: Key, attribute: str, annotation: object) -> Key:
    """Return the declaration with the name, kind and type that its attribute and annotation determine."""
    if get_origin(annotation) in (Union, types.UnionType) and types.NoneType in get_args(annotation):
        parts = tuple(part for part in get_args(annotation) if part is not types.NoneType)
        annotation = Union[parts]  # noqa: UP007
    base = get_args(annotation)[0] if get_origin(annotation) is Annotated else annotation
    element = get_args(base)[0] if get_origin(base) is tuple else None
    kinds: dict[object, Kind] = {
        Child: Kind.NODE,
        Children: Kind.NODES,
        Reasons: Kind.REASONS,
        VariableName: Kind.VARIABLE,
    }
    kind = Kind.ELEMENTS if base == Elements else kinds.get(base, Kind.CONSTANT)
    if isinstance(base, type) and issubclass(base, KeySection):
        kind = Kind.SECTION
    elif isinstance(element, type) and issubclass(element, KeySection):
        kind, base = Kind.SECTIONS, element
    return replace(declaration, name=attribute.rstrip("_"), attribute=attribute, kind=kind, value_type=base)


@cache
def _make_validator(
    declared: object, ge: float | None, gt: float | None, le: float | None
) -> TypeAdapter[object]:
    """Return the validator of the type `declared`, whose numbers must lie within the bounds."""
    parts = get_args(declared) if get_origin(declared) in (Union, types.UnionType) else (declared,)
    bounds = Field(ge=ge, gt=gt, le=le)
    bounded = [Annotated[part, bounds] if part in (int, float) else part for part in parts]
    return TypeAdapter(cast("type[object]", Union[tuple(bounded)]))  # noqa: UP007
