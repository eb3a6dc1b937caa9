"""Keys of control nodes: pydantic fields with marks, for parser, schema, checks and builder of missions."""

from __future__ import annotations

import json
import math
import sys
import types
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from inspect import get_annotations
from typing import Annotated, Any, ClassVar, Literal, TypeAlias, TypeVar, Union, cast, get_args, get_origin

from pydantic import Field, JsonValue, TypeAdapter, ValidationError, WithJsonSchema
from pydantic.fields import FieldInfo

from executive.tree.specification import (
    Child,
    Constant,
    Expression,
    Node,
    Reason,
    Reference,
    Specification,
    Value,
    VariableName,
)

PREDEFINED_LISTS = ("poses", "bins", "classes", "items")
"""Names of predefined lists. `for_each` reads the list `items` in the run; the loader of missions replaces
every other name by its list before the tree is built."""
Children: TypeAlias = tuple[Child, ...]
"""Type of a key with a list of nodes."""
Reasons: TypeAlias = tuple[Reason, ...]
"""Type of a key with a list of reasons."""
Elements: TypeAlias = Annotated[
    tuple[object, ...] | VariableName | Literal["items"],
    WithJsonSchema({"anyOf": [{"type": "array"}, {"enum": list(PREDEFINED_LISTS)}]}),
]
"""Type of a key with a list of values, the name of a variable that holds a list, or `items`: the items that
still have to be sorted."""


AnyValue: TypeAlias = JsonValue
"""Type of a key with any plain value, a reference or an expression."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Key:
    """A key of a control node or of a section: a pydantic field with marks.

    Attributes:
        max_key: For a number: key of the list of nodes whose length is the maximum of the number, or "".
        max_count: For a list of nodes: maximum number of nodes, or None.
        shorthand: True if the key may be omitted and its value written directly under the keyword.
        sibling: True if the key is a sibling of the keyword in the mission file: `catch` next to `try`.
        in_path: True if the paths of the nodes under the key contain the key.
        list_key: For a loop variable: key of the list of its values; otherwise "".
        requires_conditions: True if each node under the key must be a condition.
        accepts_expression: For a number: True if a mission may give an expression.
        is_template: For an expression: True if it is a text with expressions in braces.
        name: Name of the key in the mission file.
        attribute: Name of the field.
        value_type: Type of the value; of an optional key, the type without None.
        field: The pydantic field: description, default and bounds.
    """

    max_key: str = ""
    max_count: int | None = None
    shorthand: bool = False
    sibling: bool = False
    in_path: bool = True
    list_key: str = ""
    requires_conditions: bool = False
    accepts_expression: bool = False
    is_template: bool = False
    name: str = ""
    attribute: str = ""
    value_type: object = None
    field: FieldInfo

    @property
    def is_required(self) -> bool:
        """True if the key has no default, so that the mission must give a value."""
        return self.field.is_required()

    @cached_property
    def section(self) -> type[KeySection] | None:
        """Class of the sections under the key, or None."""
        types_under_key = list_member_types(self.value_type)
        sections = (one for one in types_under_key if isinstance(one, type) and issubclass(one, KeySection))
        return next(sections, None)

    @cached_property
    def has_nodes(self) -> bool:
        """True if the value, or a section in the value, contains nodes."""
        section = self.section
        if section is not None:
            return any(key.has_nodes for key in section.keys.values())
        return self.value_type in (Child, Children)

    @property
    def has_reasons(self) -> bool:
        """True if the value may contain names of failures."""
        return Reason in list_member_types(self.value_type)

    @cached_property
    def is_constant(self) -> bool:
        """True for a plain value: a number, a text, a boolean, or one of several words."""
        is_other_value = self.value_type in (Child, Children, VariableName, Elements, Expression)
        return not (is_other_value or self.section or self.has_reasons)

    @cached_property
    def is_plain(self) -> bool:
        """True for a constant, an expression or a list; a mission may write a reference in place of each."""
        return self.value_type in (Elements, Expression) or self.is_constant

    @cache  # noqa: B019 - keys exist as long as their classes
    def make_validator(self, max_value: int | None = None) -> TypeAdapter[object]:
        """Return the validator of a constant; `max_value` is the upper bound of a number, or None."""
        constraints = [mark for mark in self.field.metadata if not isinstance(mark, Key)]
        if max_value is not None:
            constraints.append(Field(le=max_value))
        members = get_args(self.value_type) if is_union(self.value_type) else (self.value_type,)
        bounded = [
            # A bound applies to numbers only, not to the words of a `Literal`.
            member if get_origin(member) is Literal or not constraints else Annotated[(member, *constraints)]
            for member in members
        ]
        return TypeAdapter(cast("type[object]", Union[tuple(bounded)]))  # noqa: UP007

    def interpret(self, value: Value | None, max_value: int | None) -> object:
        """Return the typed value for a value in a mission.

        A valid value replaces an invalid or unknown one: for a number, a very large number; otherwise the
        default or the first allowed value. The checks report invalid values. The behaviour of the node
        evaluates an expression.
        """
        if self.value_type == Expression:
            return value
        if self.value_type == Elements:
            if isinstance(value, Reference):
                return VariableName(value.name, value.field, value.span)
            elements = value.value if isinstance(value, Constant) else None
            return tuple(elements) if isinstance(elements, list) else "items"
        try:
            constant = value.value if isinstance(value, Constant) else None
            return self.make_validator(max_value).validate_json(json.dumps(constant), strict=True)
        except ValidationError:
            if self.value_type in (int, float):
                return sys.maxsize if self.value_type is int else math.inf
            if not self.is_required:
                return self.field.default
            default_values: Mapping[object, object] = {bool: False, str: ""}
            return next(iter(get_args(self.value_type)), default_values.get(self.value_type))


def key(
    default: object = ..., *, doc: str, ge: float | None = None, gt: float | None = None, **marks: Any
) -> Any:
    """Declare a key, as a field of a class. `marks` are attributes of `Key`.

    In `seconds: float = key(gt=0, doc="Limit [s].")`, the key has the name of the attribute, without
    a trailing underscore. The result is typed as Any, so that mypy accepts `x: int = key()`.
    """
    field = cast("FieldInfo", Field(default, description=doc, ge=ge, gt=gt))
    field.metadata.append(Key(field=field, **marks))
    return field


OwnerT = TypeVar("OwnerT", bound="KeyOwner")
"""Class of a control node or of a section."""


class KeyOwner(Specification):
    """Base of classes that declare keys, each as a field with the type and the value of the key.

    Attributes:
        keys: Declarations of the keys, by their names in the mission file.
        shorthand_key: Key whose value may directly follow the keyword, or None.
        inner_keys: Keys of the mapping below the keyword; empty if the value must not be a mapping.
        sibling_keys: Keys at the level of the keyword.
        any_of: Names of keys; a mission must give at least one of them. Empty if there is no such rule.
        settings: Constants and references as the mission writes them, by key.
    """

    keys: ClassVar[Mapping[str, Key]] = {}
    shorthand_key: ClassVar[Key | None] = None
    inner_keys: ClassVar[Mapping[str, Key]] = {}
    sibling_keys: ClassVar[Mapping[str, Key]] = {}
    any_of: ClassVar[tuple[str, ...]] = ()

    settings: Mapping[str, Value] = {}

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: object) -> None:
        super().__pydantic_init_subclass__(**kwargs)
        keys = dict(cls.keys)
        annotations = get_annotations(cls)
        for attribute, field in cls.model_fields.items():
            mark = next((mark for mark in field.metadata if isinstance(mark, Key)), None)
            if mark is not None and attribute in annotations:
                name = attribute.rstrip("_")
                key_type = _find_type(field.annotation)
                keys[name] = replace(mark, name=name, attribute=attribute, value_type=key_type, field=field)
        cls.keys = keys
        cls.shorthand_key = next((key for key in keys.values() if key.shorthand), None)
        cls.sibling_keys = {name: key for name, key in keys.items() if key.sibling}
        inner_keys = {name: key for name, key in keys.items() if not key.sibling}
        cls.inner_keys = {} if all(key.shorthand for key in inner_keys.values()) else inner_keys

    @classmethod
    def make(cls: type[OwnerT], settings: Mapping[str, Value], **values: Any) -> OwnerT:
        """Return an instance with the values of a mission, also with invalid ones.

        `values` contains the attributes of the base class, and the values of keys that `settings` lacks.
        """
        constants = cls._interpret(settings, values)
        return cast("OwnerT", cls.model_construct(None, settings=settings, **values, **constants))

    @classmethod
    def _interpret(cls, settings: Mapping[str, Value], attributes: Mapping[str, object]) -> dict[str, Any]:
        """Return the typed values of the plain keys in `settings`, and of the required plain keys."""
        keys = [key for key in cls.keys.values() if key.is_plain]
        return {
            key.attribute: key.interpret(settings.get(key.name), cls.find_max(key, attributes))
            for key in keys
            if key.is_required or key.name in settings
        }

    @classmethod
    def find_max(cls, key: Key, attributes: Mapping[str, object]) -> int | None:
        """Return the maximum of a constant: the number of nodes under `key.max_key`; None for no maximum."""
        return len(list_nodes(attributes.get(cls.keys[key.max_key].attribute))) if key.max_key else None

    def replace(self: OwnerT, **values: Any) -> OwnerT:
        """Return a copy with other values of some attributes."""
        if "settings" in values:
            values |= self._interpret(values["settings"], {**vars(self), **values})
        return super().replace(**values)

    @classmethod
    def is_value_optional(cls) -> bool:
        """Return True if the keyword of a node may stand alone, without a value."""
        return cls.shorthand_key is not None and not cls.shorthand_key.is_required

    def list_values(self) -> Sequence[tuple[Key, KeyValue]]:
        """Return every key that has a value, and the value, in the order of the declarations."""
        values: list[tuple[Key, KeyValue]] = []
        for name, key in self.keys.items():
            value = self.settings.get(name) if key.is_plain else getattr(self, key.attribute)
            if value is not None and value != ():
                values.append((key, value))
        return values

    def describe_value(self, key_name: str) -> str:
        """Return the value of a plain key as a text; for an expression, its text."""
        setting = self.settings.get(key_name)
        value = getattr(self, self.keys[key_name].attribute)
        if isinstance(setting, Expression):
            return str(setting)
        return f"{value:g}" if isinstance(value, float) else str(value)

    def list_children(self, key_name: str = "") -> Sequence[Node]:
        """Return the nodes under a key or, without a name, under all keys, including those in sections."""
        keys = [self.keys[key_name]] if key_name else self.keys.values()
        return [node for key in keys for node in list_nodes(getattr(self, key.attribute))]


class KeySection(KeyOwner):
    """Base class of sections: mappings under a key of a control node; a subclass declares the keys."""


KeyValue: TypeAlias = (
    Value | VariableName | Node | KeySection | tuple[Node | Reason | Expression | KeySection, ...]
)
"""Value of a key of a control node."""
Part: TypeAlias = Node | Reference | VariableName
"""A part of a node that the expansion of a mission changes."""
PartT = TypeVar("PartT", bound=Specification)
"""Class of a node or section."""


def list_nodes(value: object) -> list[Node]:
    """Return the nodes in the value of a key, without the descendants of these nodes."""
    if isinstance(value, Node):
        return [value]
    if isinstance(value, tuple):
        return [node for item in value for node in list_nodes(item)]
    if isinstance(value, KeySection):
        return list(value.list_children())
    return []


def map_parts(owner: PartT, change: Callable[[Part], object]) -> PartT:
    """Return a copy of a node or section with `change(part)` in place of every part that it contains.

    Parts are nodes without their descendants, references and names of variables. If no part changes, the
    result is `owner` itself.
    """
    changed: dict[str, object] = {}
    for name, value in vars(owner).items():
        if isinstance(value, _CONTAINER_TYPES):
            new_value = _map_value(value, change)
            if new_value is not value:
                changed[name] = new_value
    return owner.replace(**changed) if changed else owner


def _map_value(value: object, change: Callable[[Part], object]) -> object:
    if isinstance(value, Node | Reference | VariableName):
        return change(value)
    if isinstance(value, KeySection):
        return map_parts(value, change)
    if isinstance(value, Expression):
        operands = tuple([_map_value(operand, change) for operand in value.operands])
        is_same = _are_identical(operands, value.operands)
        return value if is_same else replace(value, operands=cast("tuple[Value, ...]", operands))
    if isinstance(value, tuple):
        items = tuple([_map_value(item, change) for item in value])
        return value if _are_identical(items, value) else items
    if isinstance(value, dict):
        values = {name: _map_value(item, change) for name, item in value.items()}
        return value if _are_identical(values.values(), value.values()) else values
    return value


_CONTAINER_TYPES = (tuple, dict, Specification, VariableName, Expression)
"""Types of the attributes of a node that contain parts."""


def _are_identical(values: Iterable[object], others: Iterable[object]) -> bool:
    return all(value is other for value, other in zip(values, others, strict=True))


def _find_type(annotation: object) -> object:
    """Return the type of a key for the annotation of its field, which lacks the marks of `Annotated`."""
    if is_union(annotation) and types.NoneType in get_args(annotation):
        annotation = Union[tuple(one for one in get_args(annotation) if one is not types.NoneType)]  # noqa: UP007
    if annotation is Node:
        return Child
    return Elements if annotation == get_args(Elements)[0] else annotation


def list_member_types(declared_type: object) -> Sequence[object]:
    """Return the types of the elements of a tuple type, of the members of a union, or the type itself."""
    if get_origin(declared_type) is tuple:
        return list_member_types(get_args(declared_type)[0])
    return get_args(declared_type) if is_union(declared_type) else (declared_type,)


def is_union(declared_type: object) -> bool:
    """Return True if a type is a union of types."""
    return get_origin(declared_type) in (Union, types.UnionType)
