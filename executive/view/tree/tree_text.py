"""Drawing of a tree as a text for a terminal, one line per node."""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Iterator, Sequence

from executive.mission.model.grammar import USE_KEYWORD
from executive.mission.outline import Connection, OutlineNode, list_child_indices

MAX_LINE_LENGTH = 100
"""Maximum length of a line [characters]."""

_MIN_TEXT_LENGTH = 40
"""Minimum length of the text of a line after its prefix [characters]."""


def draw_outline(nodes: Sequence[OutlineNode], *, ports: bool = False, reasons: bool = False) -> str:
    """Return the drawing of a tree as a text, with one line per node unless the line is too long.

    Args:
        nodes: Nodes of the tree.
        ports: True to write the variables of a skill below the skill.
        reasons: True to write the failure reasons of a skill and of a handler below the node.
    """
    lines = []
    for node, prefix, node_children in zip(
        nodes, draw_line_prefixes(nodes), list_child_indices(nodes), strict=True
    ):
        margin = prefix.replace("├─", "│ ").replace("└─", "  ") + ("│  " if node_children else "   ")
        detail = f"  ({node.detail})" if node.detail else ""
        lines += _wrap_line(f"{node.name}{detail}", prefix, margin)
        for text in _describe_node(node, ports, reasons):
            lines += _wrap_line(text, margin, margin)
    return "\n".join(lines)


def describe_reads(node: OutlineNode) -> str:
    """Return a text with the variables that a skill reads; `?` marks optional variables; "" for none."""
    return _describe_connections("reads", node.reads, "<-")


def describe_writes(node: OutlineNode) -> str:
    """Return a text with the variables that a skill writes; "" for none."""
    return _describe_connections("writes", node.writes, "->")


def describe_reasons(node: OutlineNode) -> str:
    """Return a text with the failure reasons of a skill; "" for none."""
    return f"may fail: {', '.join(node.reasons)}" if node.reasons else ""


def draw_line_prefixes(nodes: Sequence[OutlineNode]) -> list[str]:
    """Return a prefix for the line of each node: box-drawing characters, three per depth."""
    prefixes = []
    # Depths at which a later node has the same parent; the nodes are visited from the last to the first.
    open_depths: set[int] = set()
    for node in reversed(nodes):
        open_depths = {depth for depth in open_depths if depth <= node.depth}
        stem = "".join("│  " if depth in open_depths else "   " for depth in range(1, node.depth))
        joint = "" if node.depth == 0 else "├─ " if node.depth in open_depths else "└─ "
        prefixes.append(stem + joint)
        open_depths.add(node.depth)
    return prefixes[::-1]


def find_skill_names(nodes: Sequence[OutlineNode]) -> dict[str, str]:
    """Return the names of skills by path, each without the key before it: `Grasp` for `recover: Grasp`."""
    leaves = (node for node, below in zip(nodes, list_child_indices(nodes), strict=True) if not below)
    return {node.path: node.name.rpartition(": ")[2] for node in leaves}


def fold_subtrees(nodes: Sequence[OutlineNode]) -> list[OutlineNode]:
    """Return the nodes of a tree, in which one node with the name of a subtree replaces its later uses."""
    folded: list[OutlineNode] = []
    first_uses: dict[str, list[tuple[int, str, str]]] = {}
    index = 0
    while index < len(nodes):
        node = nodes[index]
        later = range(index + 1, len(nodes))
        end = next((other for other in later if nodes[other].depth <= node.depth), len(nodes))
        branch = nodes[index:end]
        known = next((subtree for subtree in node.subtrees if subtree in first_uses), None)
        if known is None:
            first_uses |= {subtree: _list_content(branch) for subtree in node.subtrees}
            folded.append(node)
            index += 1
        else:
            is_equal = first_uses[known] == _list_content(branch)
            folded.append(_make_use_node(node, known, "as above" if is_equal else "as above, other params"))
            index = end
    return folded


def select_active_nodes(nodes: Sequence[OutlineNode], running: Collection[str]) -> list[OutlineNode]:
    """Return the root and all children of running nodes; `running` contains the paths of running nodes."""
    selected = []
    # True for each ancestor of the current node that is running, by depth.
    are_ancestors_running: list[bool] = []
    for node in nodes:
        del are_ancestors_running[node.depth :]
        if all(are_ancestors_running):
            selected.append(node)
        are_ancestors_running.append(node.path in running)
    return selected


def _wrap_line(text: str, prefix: str, margin: str) -> list[str]:
    """Return a text as lines of limited length; the first begins with `prefix`, the others with `margin`."""
    return textwrap.wrap(
        text, max(MAX_LINE_LENGTH, len(margin) + _MIN_TEXT_LENGTH), initial_indent=prefix,
        subsequent_indent=f"{margin}  ", break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip


def _describe_node(node: OutlineNode, ports: bool, reasons: bool) -> Iterator[str]:
    """Yield the texts that are written below a node."""
    if reasons and node.when:
        yield node.when
    if ports and (variables := "; ".join(filter(None, (describe_reads(node), describe_writes(node))))):
        yield variables
    if reasons and node.reasons:
        yield describe_reasons(node)


def _describe_connections(verb: str, connections: Sequence[Connection], arrow: str) -> str:
    texts = []
    for connection in connections:
        variable = f"${connection.variable}" + ("" if connection.required else "?")
        has_same_name = connection.port == connection.variable
        texts.append(variable if has_same_name else f"{connection.port} {arrow} {variable}")
    return f"{verb} {', '.join(texts)}" if texts else ""


def _list_content(branch: Sequence[OutlineNode]) -> list[tuple[int, str, str]]:
    """Return depth, title and detail of each node of a branch; two uses of a subtree may differ in them."""
    return [(node.depth - branch[0].depth, node.title, node.detail) for node in branch]


def _make_use_node(node: OutlineNode, subtree: str, detail: str) -> OutlineNode:
    """Return a node with the name of a subtree, which replaces the subtree whose first node is `node`."""
    outer = node.subtrees[: node.subtrees.index(subtree)]
    return OutlineNode(
        node.path, node.name, node.depth, detail, USE_KEYWORD, subtree, node.slot, node.when, outer,
        symbol="…", shape="ellipse",
    )  # fmt: skip
