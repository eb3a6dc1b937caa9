"""Registry of control nodes: the classes that packages register as entry points, by keyword."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from typing import TypeAlias

from executive.errors import InputError
from executive.plugins import PluginEntry, list_entries
from executive.tree.node import ControlNode
from executive.tree.tree_node import make_inspection_context

ENTRY_POINT_GROUP = "executive.control_nodes"
"""Group of the entry points of control nodes."""

ControlNodes: TypeAlias = Mapping[str, type[ControlNode]]
"""Classes of control nodes by keyword."""

_KEYWORD_PATTERN = re.compile("[a-z][a-z0-9_]*")
"""Pattern of keywords: a lower-case identifier."""


def load_control_nodes() -> ControlNodes:
    """Return the class of every installed control node by its keyword.

    Raises:
        InputError: Two packages register the same keyword, or a class cannot be loaded or is incomplete.
    """
    return _load_classes(tuple(list_entries(ENTRY_POINT_GROUP, "control node").values()))


@cache
def _load_classes(entries: tuple[PluginEntry, ...]) -> ControlNodes:
    node_classes = {entry.name: entry.load() for entry in entries}
    for entry in entries:
        if problem := _find_problem(entry.name, node_classes[entry.name]):
            raise InputError(f'the entry point "{entry.name}" ({entry.value}) {problem}')
    return node_classes


def _find_problem(keyword: str, node_class: object) -> str:
    """Return an error message if `node_class` cannot be used as a control node, else ""."""
    if not (isinstance(node_class, type) and issubclass(node_class, ControlNode)):
        return "is not a ControlNode subclass"
    class_keyword = node_class.keyword
    if not _KEYWORD_PATTERN.fullmatch(keyword) or class_keyword != keyword:
        return f'must have the keyword of its class as its name, in lower case: "{class_keyword}"'
    for method in ("step", "compute_flow"):
        if getattr(node_class, method) is getattr(ControlNode, method):
            return f"has no method {method}"
    # A behaviour of py_trees sets attributes in `__init__`, so that only an instance has all reserved names.
    instance = ControlNode(make_inspection_context())
    for key in node_class.keys.values():
        # The key `as` is reserved for the label of a node.
        if key.name == "as" or hasattr(instance, key.attribute):
            return f'cannot have the key "{key.name}": the name is reserved'
    return ""
