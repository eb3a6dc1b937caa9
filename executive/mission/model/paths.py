"""Unique, readable paths of the nodes of the expanded tree.

A path names the nodes on the way: `tree/repeat/do/2:try/retry/do/Grasp`. A skill has its name or label; in a
list, control nodes and names that occur twice have a number.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

from executive.mission.model.nodes import (
    InnerNode,
    Node,
    Part,
    SectionNode,
    SkillNode,
    UnknownNode,
    UseNode,
    iterate_parts,
)
from executive.tree.keys import Kind


def with_paths(root: Node) -> Node:
    """Return the tree with the path of every node set."""
    return _assign_path(root, "", "tree")


def name_of(node: Node) -> str:
    """Return the name of a node in paths."""
    return node.label or word_of(node)


def word_of(node: Node) -> str:
    """Return the name of the skill or subtree, or the keyword of the control node."""
    match node:
        case SkillNode():
            return node.skill
        case UseNode():
            return node.name
        case InnerNode():
            return node.kind.keyword
    return "unknown"


def _assign_path(node: Node, parent: str, slot: str, name: str | None = None) -> Node:
    """Return the node as it stands in `slot` of `parent`, or there under another name.

    A bare list is the slot itself; any other node adds its own name to the path.
    """
    path = _join(parent, slot)
    if name is not None or not _is_list(node):
        path = _join(path, name or name_of(node))
    match node:
        case InnerNode():
            return replace(node, path=path, values=_parts(node, path))
        case UseNode(body=Node() as body):
            return replace(node, path=path, body=_assign_path(body, path, "do" if node.label else ""))
        case UnknownNode():
            return replace(node, path=path, parts=_assign_list_paths(node.parts, path))
    return replace(node, path=path)


def _parts(owner: InnerNode | SectionNode, path: str, prefix: str = "") -> dict[str, Part]:
    """Return the values of an owner with their paths; `prefix` is the slot of a section in its node."""
    placed: dict[str, Part] = {}
    for key, value in iterate_parts(owner):
        # The only child of a section has the name of the section.
        name = prefix if prefix and key.name == "do" else _join(prefix, key.name)
        if isinstance(value, Node):
            value = _assign_path(value, path, name if key.is_in_path or _is_list(value) else "")
        elif isinstance(value, SectionNode):
            value = replace(value, values=_parts(value, path, name))
        elif isinstance(value, tuple) and key.kind is Kind.NODES:
            value = _assign_list_paths(tuple(item for item in value if isinstance(item, Node)), path)
        elif isinstance(value, tuple):
            value = tuple(
                replace(item, values=_parts(item, path, f"{name}/{index}"))
                if isinstance(item, SectionNode)
                else item
                for index, item in enumerate(value, 1)
            )
        placed[key.name] = value
    return placed


def _assign_list_paths(items: tuple[Node, ...], parent: str) -> tuple[Node, ...]:
    """Return the nodes of a list, named so that no two have the same path."""
    names = [name_of(node) for node in items]
    count = Counter(names)
    placed = []
    for index, (node, name) in enumerate(zip(items, names, strict=True), 1):
        named = bool(node.label) or isinstance(node, SkillNode | UseNode)
        unique = name if named and count[name] == 1 else f"{index}:{name}"
        placed.append(_assign_path(node, parent, "", unique))
    return tuple(placed)


def _is_list(node: Node) -> bool:
    return isinstance(node, InnerNode) and node.is_list


def _join(*names: str) -> str:
    return "/".join(name for name in names if name)
