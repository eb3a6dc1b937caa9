"""Construction of control nodes from the nodes of a mission, for the built tree and for inspection."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from typing import cast, get_args

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.cell.protocols import Clock
from executive.mission.model.conversion import WrongType, convert_constant
from executive.mission.model.nodes import InnerNode, KeyValue, Node, SectionNode, list_nodes
from executive.mission.model.values import FailureName, Literal, LocatedName
from executive.tree.blackboard import Blackboard
from executive.tree.keys import Child, Key, KeyKind, VariableName
from executive.tree.node import ControlNode, NodeContext

BuildChild = Callable[[Node], Child]
"""Function that returns the child of a control node for a node of the mission."""


class StandIn(Behaviour):
    """Child of an inspection instance: it represents a node of the mission and is never executed.

    Attributes:
        node: Node of the mission.
    """

    def __init__(self, node: Node) -> None:
        super().__init__(node.path)
        self.node = node

    def update(self) -> Status:
        """Return INVALID, because the child is never executed."""
        return Status.INVALID


def get_mission_node(child: Child) -> Node:
    """Return the node of the mission that a child of an inspection instance represents."""
    assert isinstance(child, StandIn)
    return child.node


def make_inspection_instance(node: InnerNode) -> ControlNode:
    """Return the control node of a node of the mission for checks and diagnosis; its children are `StandIn`s.

    An invalid constant, which the check of constants reports, is replaced by a placeholder.
    """
    context = NodeContext(node.path, cast("Clock", None), Blackboard(), node.label)
    return make_instance(node, context, StandIn)


def make_instance(node: InnerNode, context: NodeContext, build_child: BuildChild) -> ControlNode:
    """Return the control node of a node of the mission, with the children that `build_child` returns."""
    return node.declaring_class(context, **_make_attributes(node, build_child))


def has_valid_constants(node: InnerNode) -> bool:
    """Return True if the values of all constants of a node are valid."""
    for key in node.declaring_class.keys.values():
        given = node.values.get(key.name)
        value = given.value if isinstance(given, Literal) else None
        if key.kind is KeyKind.CONSTANT and (given is not None or key.is_required):
            try:
                convert_constant(key, value, find_upper_bound(node, key))
            except WrongType:
                return False
    return True


def find_upper_bound(owner: InnerNode | SectionNode, key: Key) -> int | None:
    """Return the upper bound of a constant: the number of nodes under `max_key`; None for no bound."""
    return len(list_nodes(owner.values[key.max_key])) if key.max_key in owner.values else None


def _make_attributes(owner: InnerNode | SectionNode, build_child: BuildChild) -> Mapping[str, object]:
    """Return the values of the attributes of a control node or section, by attribute."""
    keys = (key for key in owner.declaring_class.keys.values() if key.is_required or key.name in owner.values)
    return {
        key.attribute: _make_attribute(owner, key, owner.values.get(key.name), build_child) for key in keys
    }


def _make_attribute(
    owner: InnerNode | SectionNode, key: Key, value: KeyValue | None, build_child: BuildChild
) -> object:
    if isinstance(value, Node):
        return build_child(value)
    if isinstance(value, SectionNode):
        return value.declaring_class(**_make_attributes(value, build_child))
    if isinstance(value, tuple):
        return tuple(
            item if isinstance(item, FailureName) else _make_attribute(owner, key, item, build_child)
            for item in value
        )
    if isinstance(value, LocatedName):
        return VariableName(value.name)
    if key.kind is KeyKind.ELEMENTS:
        elements = value.value if isinstance(value, Literal) else None
        return tuple(elements) if isinstance(elements, list) else VariableName(getattr(value, "name", ""))
    if key.kind is not KeyKind.CONSTANT:
        return ()
    constant = value.value if isinstance(value, Literal) else None
    try:
        return convert_constant(key, constant, find_upper_bound(owner, key))
    except WrongType:
        return _make_placeholder(key)


def _make_placeholder(key: Key) -> object:
    """Return a value for an invalid constant: a very large number, the default, or the first valid value."""
    if key.value_type in (int, float):
        return sys.maxsize if key.value_type is int else math.inf
    if not key.is_required:
        return key.default
    return next(iter(get_args(key.value_type)), key.value_type() if key.value_type in (bool, str) else None)
