"""Behaviours of control nodes whose children are given behaviours."""

from __future__ import annotations

from typing import Any

from py_trees.behaviour import Behaviour

from executive.tree.blackboard import NodeContext
from executive.tree.node import ControlNode
from executive.tree.specification import Node


class Given(Node):
    """A specification that stands for a behaviour."""

    behaviour: Behaviour


def specify(value: Any) -> Any:
    """Return the value with a specification in place of each behaviour."""
    if isinstance(value, list | tuple):
        return tuple(map(specify, value))
    return Given(behaviour=value) if isinstance(value, Behaviour) else value


def build(context: NodeContext, kind: type[ControlNode], **values: Any) -> Any:
    """Return the behaviour of a control node; the values of its keys may contain behaviours."""
    node = kind(**{name: specify(value) for name, value in values.items()})
    return node.Behaviour(context, node, lambda child: child.behaviour)
