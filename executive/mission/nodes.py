"""Nodes of the tree of a mission, as read from the file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import TypeVar, cast

from executive.tree.keys import Key, KeyOwner
from executive.tree.node import ControlNode
from executive.tree.specification import LocatedName, LocatedReason, Setting, Span, Value


@dataclass(frozen=True)
class Node:
    """Base class of the nodes.

    Attributes:
        span: Position in the file: of the name of the skill or subtree, of the keyword, or of the list if
            there is no keyword.
        label: Value of `as:`, or "".
        label_span: Position of the label in the file, or None.
        path: Path from the root of the expanded tree; "" before expansion. The path is unique, except that a
            subtree without label and its body have the same path if the body is a list.
        is_list: True for a sequence that is written as a list, without keyword.
    """

    span: Span
    label: str
    label_span: Span | None = field(default=None, kw_only=True)
    path: str = field(default="", kw_only=True)
    is_list = False

    @property
    def children(self) -> tuple[Node, ...]:
        """The children of the node, in the order of the keys that its class declares."""
        return ()

    @property
    def type_name(self) -> str:
        """Name of the skill or subtree, keyword of the control node, or "unknown"."""
        return "unknown"

    @property
    def path_name(self) -> str:
        """Name of the node in paths: its label, otherwise its skill, subtree or keyword."""
        return self.label or self.type_name

    def walk(self) -> Iterator[Node]:
        """Yield this node and every node below it, parents before children."""
        yield self
        for child in self.children:
            yield from child.walk()


@dataclass(frozen=True)
class SkillNode(Node):
    """A node that runs a skill.

    Attributes:
        skill: Name of the skill.
        settings: Values of params and ports in the mission, by name.
        variables_by_port: Variables of ports without a setting; by default, a variable has the port's name.
    """

    skill: str
    settings: Mapping[str, Setting]
    variables_by_port: Mapping[str, str] = field(default_factory=dict)

    @property
    def type_name(self) -> str:
        """Name of the skill."""
        return self.skill


@dataclass(frozen=True)
class InvalidNode(Node):
    """Placeholder for a node with an error that a finding reports; `parts` are the valid nodes below it."""

    parts: tuple[Node, ...] = ()

    @property
    def children(self) -> tuple[Node, ...]:
        """The nodes in `parts`."""
        return self.parts


class KeyedValues:
    """Base class of a control node and of a section, which set keys in the mission.

    Attributes:
        declaring_class: Class that declares the keys.
        values: Values that the mission sets, by key.
    """

    declaring_class: type[KeyOwner]
    values: Mapping[str, KeyValue]

    def iterate_keys(self) -> Iterator[tuple[Key, KeyValue]]:
        """Yield every key that has a value, and the value, in the order of the declarations."""
        for name, key in self.declaring_class.keys.items():
            if name in self.values:
                yield key, self.values[name]


@dataclass(frozen=True)
class NodeSection(KeyedValues):
    """A mapping below a key of a control node, such as `backoff` of `retry`.

    Attributes:
        declaring_class: Class that declares the keys.
        span: Position of the mapping.
        values: Values that the mission sets, by key.
    """

    declaring_class: type[KeyOwner]
    span: Span
    values: Mapping[str, KeyValue]


@dataclass(frozen=True)
class InnerNode(Node, KeyedValues):
    """A control node in the mission file; the run executes an instance of its `declaring_class`.

    Attributes:
        declaring_class: Class of the control node, which declares the keys.
        values: Values that the mission sets, by key.
        is_list: True for a sequence that is written as a list, without keyword.
    """

    declaring_class: type[ControlNode]
    values: Mapping[str, KeyValue]
    is_list: bool = False

    @property
    def type_name(self) -> str:
        """Keyword of the control node."""
        return self.declaring_class.keyword

    @cached_property
    def children(self) -> tuple[Node, ...]:
        """The nodes in the values of the keys and in sections."""
        return tuple(node for _, value in self.iterate_keys() for node in list_nodes(value))


@dataclass(frozen=True)
class SubtreeNode(Node):
    """A use of a subtree.

    Attributes:
        name: Name of the subtree.
        arguments: Values of the arguments, by name.
        returns: Variables of the caller, by the name of the returned variable in the subtree.
        written_variables: Variables of the caller that the subtree writes; () before expansion.
        body: Expanded subtree; None before expansion.
    """

    name: str
    arguments: Mapping[str, Setting]
    returns: Mapping[str, Setting] = field(default_factory=dict)
    written_variables: tuple[str, ...] = ()
    body: Node | None = None

    @property
    def type_name(self) -> str:
        """Name of the subtree."""
        return self.name

    @property
    def children(self) -> tuple[Node, ...]:
        """The body as the only child; no children before expansion."""
        return () if self.body is None else (self.body,)


KeyValue = Value | LocatedName | Node | NodeSection | tuple[Node | LocatedReason | NodeSection, ...]
"""Value of a key of a control node."""

PartT = TypeVar("PartT")
"""Type of a node or of a part of a node."""


def list_nodes(value: KeyValue) -> list[Node]:
    """Return the nodes in the value of a key, without the descendants of these nodes."""
    if isinstance(value, NodeSection):
        return [node for _, inner_value in value.iterate_keys() for node in list_nodes(inner_value)]
    if isinstance(value, tuple):
        return [node for item in value if not isinstance(item, LocatedReason) for node in list_nodes(item)]
    return [value] if isinstance(value, Node) else []


def map_parts(part: PartT, change: Callable[[object], object]) -> PartT:
    """Return a copy of `part` with `change(value)` in place of every value that `part` directly contains."""
    mapped: object = part
    if isinstance(part, tuple):
        mapped = tuple([change(item) for item in part])
    elif isinstance(part, dict):
        mapped = {key: change(item) for key, item in part.items()}
    elif isinstance(part, Node | Setting | NodeSection):
        values = {field.name: change(getattr(part, field.name)) for field in fields(part)}
        mapped = replace(part, **values)  # type: ignore[arg-type] # `change` keeps the type of each field.
    return cast("PartT", mapped)
