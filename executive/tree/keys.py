"""Declarations of the keys of control nodes, for parser, schema, checks and builder of missions."""

from __future__ import annotations

import types
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import Enum, auto
from functools import cache
from inspect import get_annotations
from typing import Annotated, Any, ClassVar, Literal, TypeAlias, Union, cast, get_args, get_origin

from py_trees.behaviour import Behaviour
from pydantic import Field, TypeAdapter

from executive.tree.specification import Reason

Child: TypeAlias = Behaviour
"""Child of a control node; in the checker and the diagnosis, a `ChildPlaceholder` that represents it."""


class VariableName(str):
    """Name of a variable of the mission.

    Attributes:
        field: Name of a field of the value; "" for the whole value.
    """

    field: str

    def __new__(cls, name: str, field: str = "") -> VariableName:
        """Return the name of a variable or of a field of its value."""
        variable = super().__new__(cls, name)
        variable.field = field
        return variable


Children: TypeAlias = tuple[Child, ...]
"""Type of a key with a list of nodes."""
Reasons: TypeAlias = tuple[Reason, ...]
"""Type of a key with a list of reasons."""
Elements: TypeAlias = tuple[object, ...] | VariableName | Literal["items"]
"""Type of a key with a list of values, the name of a variable that holds a list, or `items`: the items that
still have to be sorted."""
PREDEFINED_LISTS = ("poses", "bins", "classes", "items")
"""Names of predefined lists. `for_each` reads the list `items` in the run; the loader of missions replaces
every other name by its list before the tree is built."""


class KeyKind(Enum):
    """Kind of the value of a key, derived from the type annotation of its attribute."""

    NODE = auto()
    NODES = auto()
    REASONS = auto()
    REASONS_OR_SECTIONS = auto()
    VARIABLE = auto()
    ELEMENTS = auto()
    SECTION = auto()
    SECTIONS = auto()
    CONSTANT = auto()


@dataclass(frozen=True, kw_only=True)
class Key:
    """A key of a control node or of a section.

    Attributes:
        doc: Meaning of the key, one sentence.
        default: Value if the key is missing; `...` for a required key.
        ge, gt: Inclusive and exclusive lower bound of a number, or None.
        max_key: For a number: key of the list of nodes whose length is the maximum of the number, or "".
        max_count: For a list of nodes: maximum number of nodes, or None.
        shorthand: True if the key may be omitted and its value written directly under the keyword.
        sibling: True if the key is a sibling of the keyword in the mission file: `catch` next to `try`.
        in_path: True if the paths of the nodes under the key contain the key.
        failing_nodes_key: For a list of reasons: key with the nodes whose failures the reasons denote.
        list_key: For a loop variable: key of the list of its values; otherwise "".
        requires_conditions: True if each node under the key must be a condition.
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
    shorthand: bool = False
    sibling: bool = False
    in_path: bool = True
    failing_nodes_key: str = "do"
    list_key: str = ""
    requires_conditions: bool = False
    name: str = ""
    attribute: str = ""
    kind: KeyKind = KeyKind.CONSTANT
    value_type: object = None

    @property
    def is_required(self) -> bool:
        """True if the key has no default, so that the mission must give a value."""
        return self.default is ...

    @property
    def section(self) -> type[KeySection]:
        """Class of the sections under the key."""
        return cast("type[KeySection]", self.value_type)

    def make_validator(self, max_value: int | None = None) -> TypeAdapter[object]:
        """Return the validator of a constant; `max_value` is the upper bound of a number, or None."""
        return _make_validator(self.value_type, self.ge, self.gt, max_value)


key: Callable[..., Any] = Key
"""Declare a key in the body of a class: `seconds: float = key(gt=0, doc="Limit [s].")`.

`KeyOwner` derives name, kind and type from the attribute. The name of the key is the name of the
attribute, without a trailing underscore. The result is typed as Any, so that mypy accepts `x: int = key()`.
"""


class KeyOwner:
    """Base of classes that declare keys.

    Attributes:
        keys: Declarations of the keys, by their names in the mission file.
        any_of: Names of keys; a mission must give at least one of them. Empty if there is no such rule.
    """

    keys: ClassVar[Mapping[str, Key]] = {}
    any_of: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, **kwargs: object) -> None:
        super().__init_subclass__(**kwargs)
        declarations = {name: value for name, value in vars(cls).items() if isinstance(value, Key)}
        annotations = get_annotations(cls, eval_str=True) if declarations else {}
        keys = dict(cls.keys)
        for attribute, declaration in declarations.items():
            if attribute not in annotations:
                name = f"{cls.__qualname__}.{attribute}"
                raise TypeError(f"{name} has no annotation: write its type before `= key(...)`")
            key = _complete_declaration(declaration, attribute, annotations[attribute])
            keys[key.name] = key
            delattr(cls, attribute)
        cls.keys = keys

    def set_key_values(self, values: Mapping[str, object]) -> None:
        """Set the attribute of each key to its value in `values`, or to the default of the key.

        Raises:
            TypeError: A required value is missing, or an attribute in `values` belongs to no key.
        """
        remaining_values = dict(values)
        for key in self.keys.values():
            value = remaining_values.pop(key.attribute, key.default)
            if value is ...:
                raise TypeError(f"{type(self).__name__} needs a value for {key.attribute}")
            setattr(self, key.attribute, tuple(value) if isinstance(value, list) else value)
        if remaining_values:
            raise TypeError(f"{type(self).__name__} has no key {', '.join(remaining_values)}")


class KeySection(KeyOwner):
    """Base class of sections: mappings under a key of a control node; a subclass declares the keys."""

    def __init__(self, **values: object) -> None:
        self.set_key_values(values)


def _complete_declaration(declaration: Key, attribute: str, annotation: object) -> Key:
    """Return the declaration with the name, kind and type that its attribute and annotation determine."""
    # `X | None` declares an optional key of the type `X`.
    if get_origin(annotation) in (Union, types.UnionType) and types.NoneType in get_args(annotation):
        member_types = tuple(member for member in get_args(annotation) if member is not types.NoneType)
        annotation = Union[member_types]  # noqa: UP007
    value_type = get_args(annotation)[0] if get_origin(annotation) is Annotated else annotation
    element_type = get_args(value_type)[0] if get_origin(value_type) is tuple else None
    kinds: dict[object, KeyKind] = {
        Child: KeyKind.NODE,
        Children: KeyKind.NODES,
        Reasons: KeyKind.REASONS,
        VariableName: KeyKind.VARIABLE,
        Elements: KeyKind.ELEMENTS,
    }
    kind = kinds.get(value_type, KeyKind.CONSTANT)
    if isinstance(value_type, type) and issubclass(value_type, KeySection):
        kind = KeyKind.SECTION
    elif isinstance(element_type, type) and issubclass(element_type, KeySection):
        kind, value_type = KeyKind.SECTIONS, element_type
    elif get_origin(element_type) in (Union, types.UnionType) and Reason in get_args(element_type):
        (value_type,) = (member for member in get_args(element_type) if member is not Reason)
        kind = KeyKind.REASONS_OR_SECTIONS
    name = attribute.rstrip("_")
    return replace(declaration, name=name, attribute=attribute, kind=kind, value_type=value_type)


@cache
def _make_validator(
    value_type: object, ge: float | None, gt: float | None, le: float | None
) -> TypeAdapter[object]:
    """Return the validator of a type; numbers must be `>= ge`, `> gt` and `<= le`, where None is no bound."""
    is_union = get_origin(value_type) in (Union, types.UnionType)
    bounds = Field(ge=ge, gt=gt, le=le)
    member_types = tuple(
        Annotated[member, bounds] if member in (int, float) else member
        for member in (get_args(value_type) if is_union else (value_type,))
    )
    return TypeAdapter(cast("type[object]", Union[member_types]))  # noqa: UP007
