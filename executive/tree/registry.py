"""Control nodes by their words, found through the entry-point group `executive.control_nodes`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from typing import TypeAlias, cast

from executive.cell.protocols import Clock
from executive.errors import InputError
from executive.plugins import PluginEntry, registered
from executive.tree.blackboard import Blackboard
from executive.tree.node import ControlNode, Site

CONTROL_NODES = "executive.control_nodes"

ControlNodes: TypeAlias = Mapping[str, type[ControlNode]]

_WORD = re.compile("[a-z][a-z0-9_]*")


def control_nodes() -> ControlNodes:
    """Return the class of every installed control node by its word.

    Raises:
        InputError: Two packages register one word, or a class cannot be loaded or lacks a declaration.
    """
    return _load(tuple(registered(CONTROL_NODES, "control node").values()))


@cache
def _load(entries: tuple[PluginEntry, ...]) -> ControlNodes:
    nodes = {entry.name: entry.load() for entry in entries}
    for entry in entries:
        if problem := _find_problem(entry.name, nodes[entry.name]):
            raise InputError(f'the entry point "{entry.name}" ({entry.value}) {problem}')
    return nodes


def _find_problem(word: str, node: object) -> str:
    """Return the reason why a class cannot be used as a control node; "" if it can."""
    if not (isinstance(node, type) and issubclass(node, ControlNode)):
        return "is not a ControlNode subclass"
    if not _WORD.fullmatch(word) or node.word != word:
        return f'is named differently: its class has the word "{node.word}", which must be lower case'
    for method in ("step", "flow"):
        if getattr(node, method) is getattr(ControlNode, method):
            return f"has no method {method}"
    # Instances have further attributes of py_trees.
    plain = ControlNode(Site("", cast("Clock", None), Blackboard()))
    clash = [key.attribute for key in node.keys.values() if hasattr(plain, key.attribute)]
    if clash or "as" in node.keys:
        return f'cannot have the key "{(clash or ["as"])[0]}": the name is taken'
    return ""
