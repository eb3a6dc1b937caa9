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


def load_control_nodes() -> ControlNodes:
    """Return the class of every installed control node by its keyword.

    Raises:
        InputError: Two packages register the same keyword, or a class cannot be loaded or is incomplete.
    """
    return _load_classes(tuple(list_entries(ENTRY_POINT_GROUP, "control node").values()))


@cache
def _load_classes(entries: tuple[PluginEntry, ...]) -> ControlNodes:
    nodes = {entry.name: entry.load() for entry in entries}
    for entry in entries:
        if problem := _find_problem(entry.name, nodes[entry.name]):
            raise InputError(f'the entry point "{entry.name}" ({entry.value}) {problem}')
    return nodes


def _find_problem(keyword: str, node: object) -> str:
    """Return an error message if the class `node` cannot be used as a control node, else ""."""
    if not (isinstance(node, type) and issubclass(node, ControlNode)):
        return "is not a ControlNode subclass"
    if not _KEYWORD_PATTERN.fullmatch(keyword) or node.keyword != keyword:
        return f'must have the name of its class, in lower case: the class has the keyword "{node.keyword}"'
    for method in ("step", "compute_flow"):
        if getattr(node, method) is getattr(ControlNode, method):
            return f"has no method {method}"
    # Some attributes of py_trees behaviours exist only on instances.
    instance = ControlNode(NodeContext("", cast("Clock", None), Blackboard()))
    clashes = [key.attribute for key in node.keys.values() if hasattr(instance, key.attribute)]
    if clashes or "as" in node.keys:
        return f'cannot have the key "{(clashes or ["as"])[0]}": the name is taken'
    return ""
