"""Control nodes by their keywords, found through the entry-point group `executive.control_nodes`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from typing import TypeAlias, cast

from executive.cell.protocols import Clock
from executive.errors import InputError
from executive.plugins import PluginEntry, list_entries
from executive.tree.blackboard import Blackboard
from executive.tree.node import ControlNode, NodeContext

ENTRY_POINT_GROUP = "executive.control_nodes"

ControlNodes: TypeAlias = Mapping[str, type[ControlNode]]

_KEYWORD_PATTERN = re.compile("[a-z][a-z0-9_]*")


def control_nodes() -> ControlNodes:
    """Return the class of every installed control node by its keyword.

    Raises:
        InputError: Two packages register one keyword, or a class cannot be loaded or lacks a declaration.
    """
    return _load(tuple(list_entries(ENTRY_POINT_GROUP, "control node").values()))


@cache
def _load(entries: tuple[PluginEntry, ...]) -> ControlNodes:
    nodes = {entry.name: entry.load() for entry in entries}
    for entry in entries:
        if problem := _find_problem(entry.name, nodes[entry.name]):
            raise InputError(f'the entry point "{entry.name}" ({entry.value}) {problem}')
    return nodes


def _find_problem(keyword: str, node: object) -> str:
    """Return the reason why a class cannot be used as a control node; "" if it can."""
    if not (isinstance(node, type) and issubclass(node, ControlNode)):
        return "is not a ControlNode subclass"
    if not _KEYWORD_PATTERN.fullmatch(keyword) or node.keyword != keyword:
        return f'must have the name of its class, in lower case: the class has the keyword "{node.keyword}"'
    for method in ("step", "flow"):
        if getattr(node, method) is getattr(ControlNode, method):
            return f"has no method {method}"
    # Only instances have all attributes of py_trees.
    instance = ControlNode(NodeContext("", cast("Clock", None), Blackboard()))
    clashes = [key.attribute for key in node.keys.values() if hasattr(instance, key.attribute)]
    if clashes or "as" in node.keys:
        return f'cannot have the key "{(clashes or ["as"])[0]}": the name is taken'
    return ""
