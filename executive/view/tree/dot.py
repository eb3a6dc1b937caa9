"""Drawing of a tree in the DOT language of Graphviz."""

from __future__ import annotations

from collections.abc import Sequence

from executive.mission.outline import OutlineNode, list_child_indices
from executive.tree.node import ControlNode
from executive.view.text import replace_invalid_xml_characters
from executive.view.tree.node_texts import make_node_texts


def format_dot(nodes: Sequence[OutlineNode], name: str) -> str:
    """Return a tree as the text of a Graphviz digraph with the name `name`; each subtree is a cluster."""
    lines = [
        f"digraph {_quote(name)} {{",
        '  ordering=out; nodesep=0.15; fontname="sans-serif"; fontsize=11;',
        '  node [fontname="sans-serif", fontsize=11]; edge [fontname="sans-serif", fontsize=9];',
        *(f"  {line}" for line in _format_branch(0, nodes, list_child_indices(nodes))),
        "}",
    ]
    return "\n".join(lines)


def _format_branch(index: int, nodes: Sequence[OutlineNode], children: Sequence[Sequence[int]]) -> list[str]:
    """Return the statements for a node and its descendants, given its index and the children of each node."""
    node = nodes[index]
    statements = [_format_node(node)]
    for child in children[index]:
        label = f" [label={_quote(nodes[child].parent_key)}]" if nodes[child].parent_key else ""
        edge = f"{_quote(node.path)} -> {_quote(nodes[child].path)}{label};"
        statements += [*_format_branch(child, nodes, children), edge]
    if node.subtrees:
        header = f"subgraph {_quote(f'cluster {node.path}')} {{"
        label = f"label={_quote(node.joined_subtrees)}; style=dashed; color=gray;"
        statements = [header, label, *statements, "}"]
    return statements


def _format_node(node: OutlineNode) -> str:
    """Return the statement for a node: a rounded box for a skill, another shape for a control node."""
    texts = make_node_texts(node)
    label = "\n".join([f"{texts.symbol} {texts.title}".strip(), *texts.lines])
    shape = 'box, style="rounded"' if node.kind == "skill" else node.shape or ControlNode.shape
    return f"{_quote(node.path)} [label={_quote(label)}, shape={shape}, tooltip={_quote(texts.tooltip)}];"


def _quote(text: str) -> str:
    """Return a text as a quoted Graphviz string, with escapes for special characters and HTML entities."""
    text = replace_invalid_xml_characters(text).replace("&", "&amp;")
    for character, escape in (("\\", "\\\\"), ('"', '\\"'), ("\n", "\\n")):
        text = text.replace(character, escape)
    return f'"{text}"'
