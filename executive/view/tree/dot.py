"""Graphviz text of a tree."""

from __future__ import annotations

from collections.abc import Sequence

from executive.mission.outline import OutlineNode, children
from executive.tree.node import ControlNode
from executive.view.text import replace_invalid
from executive.view.tree.card import card


def dot(nodes: Sequence[OutlineNode], name: str) -> str:
    """Return a tree as a Graphviz digraph; each subtree is a cluster with its name."""
    child_indices = children(nodes)
    lines = [
        f"digraph {_quote(name)} {{",
        '  ordering=out; nodesep=0.15; fontname="sans-serif"; fontsize=11;',
        '  node [fontname="sans-serif", fontsize=11]; edge [fontname="sans-serif", fontsize=9];',
        *(f"  {line}" for line in _list_branch(0, nodes, child_indices)),
        "}",
    ]
    return "\n".join(lines)


def _list_branch(
    index: int, nodes: Sequence[OutlineNode], child_indices: Sequence[Sequence[int]]
) -> list[str]:
    """Return the lines of a node and its descendants."""
    node = nodes[index]
    lines = [_format_node(node)]
    for child in child_indices[index]:
        slot = f" [label={_quote(nodes[child].slot)}]" if nodes[child].slot else ""
        edge = f"{_quote(node.path)} -> {_quote(nodes[child].path)}{slot};"
        lines += [*_list_branch(child, nodes, child_indices), edge]
    if node.subtrees:
        head = f"subgraph {_quote(f'cluster {node.path}')} {{"
        lines = [head, f"label={_quote(node.subtree)}; style=dashed; color=gray;", *lines, "}"]
    return lines


def _format_node(node: OutlineNode) -> str:
    shown = card(node)
    label = "\n".join([f"{shown.symbol} {shown.title}".strip(), *shown.lines])
    shape = "box" if node.kind == "skill" else node.shape or ControlNode.shape
    style = ', style="rounded"' if node.kind == "skill" else ""
    tooltip = _quote(shown.tooltip)
    return f"{_quote(node.path)} [label={_quote(label)}, shape={shape}{style}, tooltip={tooltip}];"


def _quote(text: str) -> str:
    """Return a text as a quoted string of Graphviz, with escaped backslashes and HTML entities."""
    text = replace_invalid(text).replace("&", "&amp;")
    for plain, escaped in (("\\", "\\\\"), ('"', '\\"'), ("\n", "\\n")):
        text = text.replace(plain, escaped)
    return f'"{text}"'
