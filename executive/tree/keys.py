"""Keys of control nodes: declared in the class body, read by parser, schema, checks and builder."""

from __future__ import annotations

import types
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum, auto
from functools import cache
from typing import Annotated, Any, ClassVar, TypeAlias, Union, get_args, get_origin, get_type_hints

from py_trees.behaviour import Behaviour
from pydantic import Field, TypeAdapter

from executive.tree.failure import Reason

Child: TypeAlias = Behaviour
"""Child of a control node. In the checker and the diagnosis it is a `StandIn` for a node of the mission."""


class Variable(str):
    """Name of a variable."""


Children: TypeAlias = tuple[Child, ...]
Reasons: TypeAlias = tuple[Reason, ...]
Elements: TypeAlias = tuple[object, ...] | Variable
"""A list in the mission file, or the variable that holds a list."""


class Kind(Enum):
    """Content of a key, by the annotation of its attribute."""

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
        doc: Its meaning, one sentence.
        default: Value if the key is missing; `...` for a required key.
        ge, gt: Inclusive and exclusive lower bound of a number, or None.
        max_of: Name of the key whose number of nodes is the upper bound of this number, or "".
        max_count: Largest number of nodes in a list, or None.
        is_bare: True if the value may stand directly under the word of the node (or the key of the section).
        is_partner: True if the key stands at the same level as the word of the node, as `catch` beside `try`.
        is_in_path: False if the key is left out of the paths of its nodes.
        raised_under: For a list of reasons: key that holds the nodes which raise these failures.
        element_of: For a variable: key with the list whose elements the variable takes in turn; or "".
        name: Name in the mission file.
        attribute: Name in the class.
        kind: Content.
        type: Type of a constant, or class of a section.
    """

    doc: str
    default: object = ...
    ge: float | None = None
    gt: float | None = None
    max_of: str = ""
    max_count: int | None = None
    is_bare: bool = False
    is_partner: bool = False
    is_in_path: bool = True
    of: str = "do"
    element_of: str = ""
    name: str = ""
    attribute: str = ""
    kind: Kind = Kind.CONSTANT
    type: Any = None

    @property
    def is_required(self) -> bool:
        """True if the mission must give a value."""
        return self.default is ...

    @property
    def section(self) -> type[KeySection]:
        """The class of the section or sections under the key."""
        declared: type[KeySection] = self.type
        return declared

    def adapter(self, most: int | None = None) -> TypeAdapter[Any]:
        """Return the validator of a constant; `most` is the upper bound of a number, or None."""
        return _adapter(self.type, self.ge, self.gt, most)


def key(
    *,
    doc: str,
    default: object = ...,
    ge: float | None = None,
    gt: float | None = None,
    max_of: str = "",
    max_count: int | None = None,
    bare: bool = False,
    partner: bool = False,
    in_path: bool = True,
    of: str = "do",
    element_of: str = "",
) -> Any:
    """Declare a key; see `Key` for the meaning of the arguments.

    The key has the name of the attribute, without a trailing underscore.
    """
    return Key(doc, default, ge, gt, max_of, max_count, bare, partner, in_path, of, element_of)


class KeyOwner:
    """Base of classes that declare keys.

    Attributes:
        keys: The declared keys by their name in the mission file.
        one_of: Keys of which at least one must be given.
    """

    keys: ClassVar[Mapping[str, Key]] = {}
    one_of: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        declared = {name: value for name, value in vars(cls).items() if isinstance(value, Key)}
        hints = get_type_hints(cls, include_extras=True) if declared else {}
        if missing := [name for name in declared if name not in hints]:
            name = f"{cls.__qualname__}.{missing[0]}"
            raise TypeError(f"{name} has no annotation: write its type before `= key(...)`")
        keys = dict(cls.keys)
        for attribute, value in declared.items():
            complete = _complete(value, attribute, hints[attribute])
            keys[complete.name] = complete
            delattr(cls, attribute)
        cls.keys = keys

    def set_keys(self, values: Mapping[str, object]) -> None:
        """Set the attributes of all keys; `values` holds them by attribute, other keys get their defaults.

        Raises:
            TypeError: A required value is missing, or a value belongs to no key.
        """
        left = dict(values)
        for declared in self.keys.values():
            value = left.pop(declared.attribute, declared.default)
            if value is ...:
                raise TypeError(f"{type(self).__name__} needs a value for {declared.attribute}")
            setattr(self, declared.attribute, tuple(value) if isinstance(value, list) else value)
        if left:
            raise TypeError(f"{type(self).__name__} has no key {', '.join(left)}")


class KeySection(KeyOwner):
    """Mapping below a key of a control node: a subclass declares its keys."""

    def __init__(self, **values: object) -> None:
        self.set_keys(values)


def _complete(declared: Key, attribute: str, hint: Any) -> Key:
    """Return a key with name, attribute, kind and type, as its attribute and annotation declare them."""
    if get_origin(hint) in (Union, types.UnionType) and types.NoneType in get_args(hint):
        hint = Union[tuple(part for part in get_args(hint) if part is not types.NoneType)]  # noqa: UP007
    base = get_args(hint)[0] if get_origin(hint) is Annotated else hint
    listed = get_args(base)[0] if get_origin(base) is tuple else None
    simple = {Child: Kind.NODE, Children: Kind.NODES, Reasons: Kind.REASONS, Variable: Kind.VARIABLE}
    kind = Kind.ELEMENTS if base == Elements else simple.get(base, Kind.CONSTANT)
    if isinstance(base, type) and issubclass(base, KeySection):
        kind = Kind.SECTION
    elif isinstance(listed, type) and issubclass(listed, KeySection):
        kind, base = Kind.SECTIONS, listed
    return replace(declared, name=attribute.rstrip("_"), attribute=attribute, kind=kind, type=base)


@cache
def _adapter(declared: Any, ge: float | None, gt: float | None, le: float | None) -> TypeAdapter[Any]:
    parts = get_args(declared) if get_origin(declared) in (Union, types.UnionType) else (declared,)
    bounds = Field(ge=ge, gt=gt, le=le)
    bounded = [Annotated[part, bounds] if part in (int, float) else part for part in parts]
    union: Any = Union[tuple(bounded)]  # noqa: UP007
    return TypeAdapter(union)
