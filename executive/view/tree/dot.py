"""Graphviz text of a tree."""

from __future__ import annotations

from collections.abc import Sequence

from executive.mission.outline import OutlineNode, children
from executive.tree.node import ControlNode
from executive.view.text import replace_invalid
from executive.view.tree.card import card


def dot(nodes: Sequence[OutlineNode], name: str) -> str:
    """Return a tree as a Graphviz digraph; a subtree is a cluster of its name."""
    below = children(nodes)
    lines = [
        f"digraph {_quoted(name)} {{",
        '  ordering=out; nodesep=0.15; fontname="sans-serif"; fontsize=11;',
        '  node [fontname="sans-serif", fontsize=11]; edge [fontname="sans-serif", fontsize=9];',
        *(f"  {line}" for line in _branch(0, nodes, below)),
        "}",
    ]
    return "\n".join(lines)


def _branch(index: int, nodes: Sequence[OutlineNode], below: Sequence[Sequence[int]]) -> list[str]:
    """Return the lines of a node and of all that hangs from it."""
    node = nodes[index]
    lines = [_node(node)]
    for child in below[index]:
        slot = f" [label={_quoted(nodes[child].slot)}]" if nodes[child].slot else ""
        edge = f"{_quoted(node.path)} -> {_quoted(nodes[child].path)}{slot};"
        lines += [*_branch(child, nodes, below), edge]
    if node.subtrees:
        head = f"subgraph {_quoted(f'cluster {node.path}')} {{"
        lines = [head, f"label={_quoted(node.subtree)}; style=dashed; color=gray;", *lines, "}"]
    return lines


def _node(node: OutlineNode) -> str:
    shown = card(node)
    label = "\n".join([f"{shown.symbol} {shown.title}".strip(), *shown.lines])
    shape = "box" if node.kind == "skill" else node.shape or ControlNode.shape
    style = ', style="rounded"' if node.kind == "skill" else ""
    tooltip = _quoted(shown.tooltip)
    return f"{_quoted(node.path)} [label={_quoted(label)}, shape={shape}{style}, tooltip={tooltip}];"


def _quoted(text: str) -> str:
    """Return a text as a quoted string, in which Graphviz knows backslashes and the entities of HTML."""
    text = replace_invalid(text).replace("&", "&amp;")
    for plain, escaped in (("\\", "\\\\"), ('"', '\\"'), ("\n", "\\n")):
        text = text.replace(plain, escaped)
    return f'"{text}"'
