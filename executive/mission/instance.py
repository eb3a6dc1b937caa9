"""Construction of control nodes from mission nodes, for runs, checks and the diagnosis."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from typing import get_args

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.mission.nodes import InnerNode, KeyedValues, KeyValue, Node, NodeSection, list_nodes
from executive.mission.ports import ValueProblem, convert_constant
from executive.tree.keys import Child, Key, KeyKind, VariableName
from executive.tree.node import ControlNode
from executive.tree.specification import Literal, LocatedName, LocatedReason, Reference
from executive.tree.tree_node import NodeContext, make_inspection_context

BuildChild = Callable[[Node], Child]
"""Function that returns the child of a control node for a mission node."""


class ChildPlaceholder(Behaviour):
    """Behaviour that represents the mission node `node` for checks and the diagnosis; never executed."""

    def __init__(self, node: Node) -> None:
        super().__init__(node.path)
        self.node = node

    def update(self) -> Status:
        """Return INVALID, because placeholders are never executed."""
        return Status.INVALID


def get_mission_node(child: Child) -> Node:
    """Return the mission node that a placeholder represents."""
    assert isinstance(child, ChildPlaceholder)
    return child.node


def make_inspection_instance(node: InnerNode) -> ControlNode:
    """Return a control node with `ChildPlaceholder`s as children, for checks and the diagnosis.

    Valid constants replace invalid constants of the mission, which `check_constants` reports.
    """
    return make_instance(node, make_inspection_context(node.path, node.label), ChildPlaceholder)


def make_instance(node: InnerNode, context: NodeContext, build_child: BuildChild) -> ControlNode:
    """Return the control node for a mission node; `build_child` returns its children."""
    return node.declaring_class(context, **_make_attributes(node, build_child))


def find_upper_bound(owner: KeyedValues, key: Key) -> int | None:
    """Return the maximum of a constant: the number of nodes under `key.max_key`; None for no maximum."""
    return len(list_nodes(owner.values[key.max_key])) if key.max_key in owner.values else None


def _make_attributes(owner: KeyedValues, build_child: BuildChild) -> Mapping[str, object]:
    """Return the values of all attributes that the constructor of a control node or section needs."""
    keys = (key for key in owner.declaring_class.keys.values() if key.is_required or key.name in owner.values)
    return {key.attribute: _make_value(owner, key, owner.values.get(key.name), build_child) for key in keys}


def _make_value(owner: KeyedValues, key: Key, value: KeyValue | None, build_child: BuildChild) -> object:
    """Return the value of the attribute for `key`; `value` is None if the mission lacks the required key."""
    if isinstance(value, Node):
        return build_child(value)
    if isinstance(value, NodeSection):
        return value.declaring_class(**_make_attributes(value, build_child))
    if isinstance(value, tuple):
        return tuple(
            item if isinstance(item, LocatedReason) else _make_value(owner, key, item, build_child)
            for item in value
        )
    if isinstance(value, LocatedName):
        return VariableName(value.name)
    if key.kind is KeyKind.ELEMENTS:
        if isinstance(value, Reference):
            return VariableName(value.name, value.field)
        elements = value.value if isinstance(value, Literal) else None
        # `check_constants` reports other values.
        return tuple(elements) if isinstance(elements, list) else "items"
    if key.kind is not KeyKind.CONSTANT:
        return ()
    try:
        return _convert_constant(owner, key, value)
    except ValueProblem:
        return _make_valid_constant(key)


def _convert_constant(owner: KeyedValues, key: Key, value: KeyValue | None) -> object:
    """Return the converted value of a constant, or raise ValueProblem."""
    constant = value.value if isinstance(value, Literal) else None
    return convert_constant(key, constant, find_upper_bound(owner, key))


def _make_valid_constant(key: Key) -> object:
    """Return a valid value of a constant: a very large number, the default, or the first allowed value."""
    if key.value_type in (int, float):
        return sys.maxsize if key.value_type is int else math.inf
    if not key.is_required:
        return key.default
    return next(iter(get_args(key.value_type)), key.value_type() if key.value_type in (bool, str) else None)
