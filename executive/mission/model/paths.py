"""A unique, readable path for every node of the tree that runs.

A path names what is on the way: `tree/repeat/do/2:try/retry/do/Grasp`. A skill goes by its name or
label; in a list, control nodes and whatever stands there twice carry their number.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

from executive.mission.model import nodes
from executive.mission.model.nodes import Node


def with_paths(root: Node) -> Node:
    """Return the tree with the path of every node set."""
    return _placed(root, "", "tree")


def name_of(node: Node) -> str:
    """Return what a node is called in a path."""
    if node.label:
        return node.label
    if isinstance(node, nodes.SkillNode):
        return node.skill
    return node.name if isinstance(node, nodes.UseNode) else node.word


def _placed(node: Node, parent: str, slot: str, name: str | None = None) -> Node:
    """Return the node as it stands in `slot` of `parent`, or there under another name.

    A bare list is the slot itself; any other node adds its own name to the path.
    """
    path = _join(parent, slot)
    if name is not None or not _is_bare(node):
        path = _join(path, name or name_of(node))
    changes: dict[str, Any] = {"path": path}
    for field in fields(node):
        part = getattr(node, field.name)
        if isinstance(part, Node):
            changes[field.name] = _placed(part, path, _slot(node, field.name))
        elif isinstance(part, tuple) and any(isinstance(item, Node) for item in part):
            changes[field.name] = _listed(part, path)
    if isinstance(node, nodes.TryNode):
        changes["catches"] = tuple(
            replace(catch, do=_placed(catch.do, path, f"catch/{index}"))
            for index, catch in enumerate(node.catches, 1)
        )
    return replace(node, **changes)


def _slot(parent: Node, field: str) -> str:
    """Return what a child is called in the path of its parent.

    The body of a `try`, unless it is a bare list, and of a `use`, unless that has a label, is not named.
    """
    if isinstance(parent, nodes.TryNode) and field == "do":
        return "do" if _is_bare(parent.do) else ""
    if isinstance(parent, nodes.UseNode):
        return "do" if parent.label else ""
    return "finally" if field == "finish" else field


def _listed(items: Sequence[Node], parent: str) -> tuple[Node, ...]:
    """Return the nodes of a list, named so that no two have the same path."""
    names = [name_of(node) for node in items]
    count = Counter(names)
    placed = []
    for index, (node, name) in enumerate(zip(items, names, strict=True), 1):
        named = bool(node.label) or isinstance(node, nodes.SkillNode | nodes.UseNode)
        unique = name if named and count[name] == 1 else f"{index}:{name}"
        placed.append(_placed(node, parent, "", unique))
    return tuple(placed)


def _is_bare(node: Node) -> bool:
    return isinstance(node, nodes.SequenceNode) and node.listed


def _join(*parts: str) -> str:
    return "/".join(part for part in parts if part)
