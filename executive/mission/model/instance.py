"""Instances of control nodes, made from the nodes of a mission."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from typing import cast, get_args

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.cell.protocols import Clock
from executive.mission.model.nodes import InnerNode, Node, Part, SectionNode, nodes_of
from executive.mission.model.typed import WrongType, read_constant
from executive.mission.model.values import FailureName, Literal, Named
from executive.tree.blackboard import Blackboard
from executive.tree.keys import Child, Key, Kind, VariableName
from executive.tree.node import ControlNode, NodeContext

BuildChild = Callable[[Node], Child]
"""Function that returns a child for a node of the mission."""


class StandIn(Behaviour):
    """Child of an instance that never runs: it stands for a node of the mission.

    Attributes:
        node: The node.
    """

    def __init__(self, node: Node) -> None:
        super().__init__(node.path)
        self.node = node

    def update(self) -> Status:
        """Do nothing."""
        return Status.INVALID


def node_of(child: Child) -> Node:
    """Return the node for which a child of an instance stands."""
    assert isinstance(child, StandIn)
    return child.node


def inspection_instance(node: InnerNode) -> ControlNode:
    """Return an instance that never runs: it answers questions about its node. Its children are `StandIn`s.

    A wrong constant, about which another check complains, is replaced by a default or by a large number.
    """
    context = NodeContext(node.path, cast("Clock", None), Blackboard(), node.label)
    return make_instance(node, context, StandIn)


def make_instance(node: InnerNode, context: NodeContext, build: BuildChild) -> ControlNode:
    """Return the control node that a node of the mission describes; `build` makes its children."""
    return node.kind(context, **_values(node, build))


def has_valid_constants(node: InnerNode) -> bool:
    """Return True if all constants of a node have values that fit."""
    for key in node.kind.keys.values():
        part = node.values.get(key.name)
        value = part.value if isinstance(part, Literal) else None
        if key.kind is Kind.CONSTANT and (part is not None or key.is_required):
            try:
                read_constant(key, value, find_upper_bound(node, key))
            except WrongType:
                return False
    return True


def find_upper_bound(owner: InnerNode | SectionNode, key: Key) -> int | None:
    """Return the largest allowed number of a constant, if it counts nodes under another key."""
    return len(nodes_of(owner.values[key.max_key])) if key.max_key in owner.values else None


def _values(owner: InnerNode | SectionNode, build: BuildChild) -> Mapping[str, object]:
    keys = (key for key in owner.kind.keys.values() if key.is_required or key.name in owner.values)
    return {key.attribute: _value(owner, key, owner.values.get(key.name), build) for key in keys}


def _value(owner: InnerNode | SectionNode, key: Key, part: Part | None, build: BuildChild) -> object:
    """Return the value of an attribute."""
    if isinstance(part, Node):
        return build(part)
    if isinstance(part, SectionNode):
        return part.kind(**_values(part, build))
    if isinstance(part, tuple):
        return tuple(
            item if isinstance(item, FailureName) else _value(owner, key, item, build) for item in part
        )
    if isinstance(part, Named):
        return VariableName(part.name)
    if key.kind is Kind.ELEMENTS:
        elements = part.value if isinstance(part, Literal) else None
        return tuple(elements) if isinstance(elements, list) else VariableName(getattr(part, "name", ""))
    if key.kind is not Kind.CONSTANT:
        return ()
    try:
        return read_constant(
            key, part.value if isinstance(part, Literal) else None, find_upper_bound(owner, key)
        )
    except WrongType:
        return _placeholder(key)


def _placeholder(key: Key) -> object:
    """Return a value instead of a wrong constant: the default, or a very large number."""
    if key.value_type in (int, float):
        return sys.maxsize if key.value_type is int else math.inf
    if not key.is_required:
        return key.default
    return next(iter(get_args(key.value_type)), key.value_type() if key.value_type in (bool, str) else None)
