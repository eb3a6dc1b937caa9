"""Unique, readable paths of the nodes of the expanded tree.

A path contains the names of all ancestors: `tree/repeat/do/2:try/retry/do/Grasp`. The name of a node is its
label, skill, subtree or keyword. In a list, control nodes without label and duplicate names get an index.
A subtree without label and its body have the same path if the body is a list.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

from executive.mission.model.nodes import (
    InnerNode,
    InvalidNode,
    KeyedValues,
    KeyValue,
    Node,
    NodeSection,
    SkillNode,
    SubtreeNode,
)
from executive.tree.keys import KeyKind


def assign_paths(root: Node) -> Node:
    """Return the tree with the paths of all nodes."""
    return _assign_path(root, "", "tree")


def _assign_path(node: Node, parent_path: str, key_path: str, name: str = "") -> Node:
    """Return the node with its path and the paths of its descendants.

    `key_path` is the part of the path for the key of the parent that contains the node, or "". `name` is the
    last part of the path; the default is `node.path_name`, and for a list no name.
    """
    path = _join(parent_path, key_path, name or ("" if node.is_list else node.path_name))
    match node:
        case InnerNode():
            return replace(node, path=path, values=_assign_value_paths(node, path))
        case SubtreeNode(body=Node() as body):
            return replace(node, path=path, body=_assign_path(body, path, "do" if node.label else ""))
        case InvalidNode():
            return replace(node, path=path, parts=_assign_list_paths(node.parts, path))
    return replace(node, path=path)


def _assign_value_paths(owner: KeyedValues, path: str, section_path: str = "") -> dict[str, KeyValue]:
    """Return the values by key, with paths for the nodes in the values; `path` is that of the control node.

    If `owner` is a section, `section_path` is its path in the control node: `backoff`, or `cases/2`.
    """
    values: dict[str, KeyValue] = {}
    for key, value in owner.iterate_keys():
        # In the path of a child below `do` of a section, the key `do` is omitted.
        key_path = section_path if section_path and key.name == "do" else _join(section_path, key.name)
        if isinstance(value, Node):
            value = _assign_path(value, path, key_path if key.in_path or value.is_list else "")
        elif isinstance(value, NodeSection):
            value = replace(value, values=_assign_value_paths(value, path, key_path))
        elif isinstance(value, tuple) and key.kind is KeyKind.NODES:
            value = _assign_list_paths(tuple(item for item in value if isinstance(item, Node)), path)
        elif isinstance(value, tuple):
            value = tuple(
                replace(item, values=_assign_value_paths(item, path, f"{key_path}/{index}"))
                if isinstance(item, NodeSection)
                else item
                for index, item in enumerate(value, 1)
            )
        values[key.name] = value
    return values


def _assign_list_paths(nodes: tuple[Node, ...], parent_path: str) -> tuple[Node, ...]:
    counts = Counter(node.path_name for node in nodes)

    def get_unique_name(index: int, node: Node) -> str:
        name = node.path_name
        has_own_name = bool(node.label) or isinstance(node, SkillNode | SubtreeNode)
        return name if has_own_name and counts[name] == 1 else f"{index}:{name}"

    names = [get_unique_name(index, node) for index, node in enumerate(nodes, 1)]
    return tuple(_assign_path(node, parent_path, "", name) for node, name in zip(nodes, names, strict=True))


def _join(*names: str) -> str:
    return "/".join(name for name in names if name)
