"""Drawing of a tree as a Graphviz text."""

from __future__ import annotations

from collections.abc import Sequence

from executive.mission.outline import OutlineNode, list_child_indices
from executive.tree.node import ControlNode
from executive.view.text import replace_invalid_characters
from executive.view.tree.card import make_card


def format_dot(nodes: Sequence[OutlineNode], name: str) -> str:
    """Return a tree as the text of a Graphviz digraph with the name `name`; each subtree is a cluster."""
    child_lists = list_child_indices(nodes)
    lines = [
        f"digraph {_quote(name)} {{",
        '  ordering=out; nodesep=0.15; fontname="sans-serif"; fontsize=11;',
        '  node [fontname="sans-serif", fontsize=11]; edge [fontname="sans-serif", fontsize=9];',
        *(f"  {line}" for line in _list_lines(0, nodes, child_lists)),
        "}",
    ]
    return "\n".join(lines)


def _list_lines(index: int, nodes: Sequence[OutlineNode], child_lists: Sequence[Sequence[int]]) -> list[str]:
    """Return the Graphviz lines of the node with an index and of its descendants."""
    node = nodes[index]
    lines = [_describe_node(node)]
    for child in child_lists[index]:
        label = f" [label={_quote(nodes[child].slot)}]" if nodes[child].slot else ""
        edge = f"{_quote(node.path)} -> {_quote(nodes[child].path)}{label};"
        lines += [*_list_lines(child, nodes, child_lists), edge]
    if node.subtrees:
        header = f"subgraph {_quote(f'cluster {node.path}')} {{"
        lines = [header, f"label={_quote(node.subtree)}; style=dashed; color=gray;", *lines, "}"]
    return lines


def _describe_node(node: OutlineNode) -> str:
    card = make_card(node)
    label = "\n".join([f"{card.symbol} {card.title}".strip(), *card.lines])
    shape = "box" if node.kind == "skill" else node.shape or ControlNode.shape
    style = ', style="rounded"' if node.kind == "skill" else ""
    tooltip = _quote(card.tooltip)
    return f"{_quote(node.path)} [label={_quote(label)}, shape={shape}{style}, tooltip={tooltip}];"


def _quote(text: str) -> str:
    """Return a text as a quoted Graphviz string, with escapes for special characters and HTML entities."""
    text = replace_invalid_characters(text).replace("&", "&amp;")
    for character, escaped in (("\\", "\\\\"), ('"', '\\"'), ("\n", "\\n")):
        text = text.replace(character, escaped)
    return f'"{text}"'
