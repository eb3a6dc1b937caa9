"""A tree as text for a terminal."""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Iterator, Sequence

from executive.mission.model.grammar import USE
from executive.mission.outline import Connection, OutlineNode, children

WIDTH = 100
"""Largest length of a line [characters]."""

_MIN_TEXT_WIDTH = 40


def draw_outline(nodes: Sequence[OutlineNode], *, ports: bool = False, reasons: bool = False) -> str:
    """Return an outline as text, with one line per node unless it is too long.

    Args:
        nodes: The outline.
        ports: Write the variables that a skill reads and writes below the skill.
        reasons: Write the failure reasons of a skill and of a catch below the node.
    """
    lines = []
    for node, branch, below in zip(nodes, draw_branches(nodes), children(nodes), strict=True):
        margin = branch.replace("├─", "│ ").replace("└─", "  ") + ("│  " if below else "   ")
        detail = f"  ({node.detail})" if node.detail else ""
        lines += _wrap_line(f"{node.name}{detail}", branch, margin)
        for sentence in _describe_below(node, ports, reasons):
            lines += _wrap_line(sentence, margin, margin)
    return "\n".join(lines)


def describe_reads(node: OutlineNode) -> str:
    """Return the variables that a skill reads, with `?` for one that may be unset; "" if none."""
    return _describe_connections("reads", node.reads, "<-")


def describe_writes(node: OutlineNode) -> str:
    """Return the variables that a skill writes; "" if none."""
    return _describe_connections("writes", node.writes, "->")


def describe_reasons(node: OutlineNode) -> str:
    """Return the failure reasons of a skill; "" if none."""
    return f"may fail: {', '.join(node.reasons)}" if node.reasons else ""


def draw_branches(nodes: Sequence[OutlineNode]) -> list[str]:
    """Return the lines from the root to each node, as text before the node."""
    joints = []
    # Depths at which a later node has the same parent; the nodes are visited from the last to the first.
    more_follow: set[int] = set()
    for node in reversed(nodes):
        more_follow = {depth for depth in more_follow if depth <= node.depth}
        stem = "".join("│  " if depth in more_follow else "   " for depth in range(1, node.depth))
        joint = "" if node.depth == 0 else "├─ " if node.depth in more_follow else "└─ "
        joints.append(stem + joint)
        more_follow.add(node.depth)
    return joints[::-1]


def find_skill_names(nodes: Sequence[OutlineNode]) -> dict[str, str]:
    """Return the names of the skills by path, without their role (`recover` in `recover: Grasp`)."""
    leaves = (node for node, below in zip(nodes, children(nodes), strict=True) if not below)
    return {node.path: node.name.rpartition(": ")[2] for node in leaves}


def fold_subtrees(nodes: Sequence[OutlineNode]) -> list[OutlineNode]:
    """Return an outline with the first use of each subtree, and a node with its name for each other use."""
    shown: list[OutlineNode] = []
    first: dict[str, list[tuple[int, str, str]]] = {}
    index = 0
    while index < len(nodes):
        node = nodes[index]
        later = range(index + 1, len(nodes))
        end = next((other for other in later if nodes[other].depth <= node.depth), len(nodes))
        branch = nodes[index:end]
        known = next((subtree for subtree in node.subtrees if subtree in first), None)
        if known is None:
            first |= {subtree: _list_content(branch) for subtree in node.subtrees}
            shown.append(node)
            index += 1
        else:
            same = first[known] == _list_content(branch)
            shown.append(_make_use(node, known, "as above" if same else "as above, other params"))
            index = end
    return shown


def select_open(nodes: Sequence[OutlineNode], running: Collection[str]) -> list[OutlineNode]:
    """Return the root and the children of running nodes."""
    shown = []
    # Whether the last node at each depth is running.
    ancestors_running: list[bool] = []
    for node in nodes:
        del ancestors_running[node.depth :]
        if all(ancestors_running):
            shown.append(node)
        ancestors_running.append(node.path in running)
    return shown


def _wrap_line(text: str, first: str, other: str) -> list[str]:
    """Return a text in lines of limited length, with a prefix for the first line and for the others."""
    return textwrap.wrap(
        text, max(WIDTH, len(other) + _MIN_TEXT_WIDTH), initial_indent=first, subsequent_indent=f"{other}  ",
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip


def _describe_below(node: OutlineNode, ports: bool, reasons: bool) -> Iterator[str]:
    """Yield the sentences below a node."""
    if reasons and node.when:
        yield node.when
    if ports and (flow := "; ".join(filter(None, (describe_reads(node), describe_writes(node))))):
        yield flow
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
    """Return depths, titles and details of a branch, in which two uses of a subtree may differ."""
    return [(node.depth - branch[0].depth, node.title, node.detail) for node in branch]


def _make_use(node: OutlineNode, subtree: str, detail: str) -> OutlineNode:
    """Return a node that replaces a subtree by its name, and keeps the names of the subtrees around it."""
    outer = node.subtrees[: node.subtrees.index(subtree)]
    return OutlineNode(
        node.path, node.name, node.depth, detail, USE, subtree, node.slot, node.when, outer, symbol="…",
        shape="ellipse",
    )  # fmt: skip
