"""Nodes of the tree of a mission, as the file says them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeAlias

from executive.mission.model.values import FailureName, Named, Setting, Value
from executive.mission.source import Mark
from executive.tree.keys import Key, KeyOwner
from executive.tree.node import ControlNode


@dataclass(frozen=True)
class Node:
    """Base of everything a tree is made of.

    Attributes:
        mark: Place of the word that names the node in the file.
        label: Value of `as:`, or "".
        label_mark: Place of the label.
        path: Unique path from the root of the expanded tree; "" before expansion.
    """

    mark: Mark
    label: str
    label_mark: Mark | None = field(default=None, kw_only=True)
    path: str = field(default="", kw_only=True)

    @property
    def children(self) -> tuple[Node, ...]:
        """The nodes directly inside this one, in the order of their keys."""
        return ()

    def walk(self) -> Iterator[Node]:
        """Yield this node and every node below it, top to bottom."""
        yield self
        for child in self.children:
            yield from child.walk()


@dataclass(frozen=True)
class SkillNode(Node):
    """A skill and what the mission sets of it.

    Attributes:
        names: Variables of ports that the mission does not wire and that have another name than the port.
    """

    skill: str
    settings: Mapping[str, Setting]
    names: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class UnknownNode(Node):
    """A node that could not be read; a finding says why.

    Attributes:
        parts: The nodes that could be read of it.
    """

    parts: tuple[Node, ...] = ()

    @property
    def children(self) -> tuple[Node, ...]:
        """The parts."""
        return self.parts


@dataclass(frozen=True)
class SectionNode:
    """A mapping below a key of a control node: the values of its keys.

    Attributes:
        kind: Class that declares the keys.
    """

    kind: type[KeyOwner]
    mark: Mark
    values: Mapping[str, Part]


@dataclass(frozen=True)
class InnerNode(Node):
    """A control node.

    Attributes:
        kind: Its class.
        values: Values of its keys; a key that is missing in the file is missing here.
        is_list: True for a bare list, which has no word.
    """

    kind: type[ControlNode]
    values: Mapping[str, Part]
    is_list: bool = False

    @cached_property
    def children(self) -> tuple[Node, ...]:
        """The nodes under its keys, those in sections included."""
        return tuple(node for _, value in iterate_parts(self) for node in nodes_of(value))


@dataclass(frozen=True)
class UseNode(Node):
    """A subtree by name.

    Attributes:
        arguments: Values of its arguments.
        returns: Other names for the variables it returns.
        returned: The variables it returns, as they are called here.
        body: The subtree with the arguments put in; None until the mission is expanded.
    """

    name: str
    arguments: Mapping[str, Setting]
    returns: Mapping[str, Setting] = field(default_factory=dict)
    returned: tuple[str, ...] = ()
    body: Node | None = None

    @property
    def children(self) -> tuple[Node, ...]:
        """The body."""
        return () if self.body is None else (self.body,)


Part: TypeAlias = "Value | Named | Node | SectionNode | tuple[Node | FailureName | SectionNode, ...]"
"""Value of a key of a control node."""


def iterate_parts(of: InnerNode | SectionNode) -> Iterator[tuple[Key, Part]]:
    """Yield the keys that are given, in the order of their declaration, with their values."""
    for name, key in of.kind.keys.items():
        if name in of.values:
            yield key, of.values[name]


def nodes_of(part: Part) -> list[Node]:
    """Return the nodes in the value of a key."""
    if isinstance(part, SectionNode):
        return [node for _, value in iterate_parts(part) for node in nodes_of(value)]
    if isinstance(part, tuple):
        return [node for item in part if not isinstance(item, FailureName) for node in nodes_of(item)]
    return [part] if isinstance(part, Node) else []
