"""Text of a tree for a terminal."""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Iterator, Sequence

from executive.mission.model.grammar import USE
from executive.mission.outline import Connection, OutlineNode, children

WIDTH = 100
"""Line length [columns]."""

_MIN_TEXT_WIDTH = 40


def draw(nodes: Sequence[OutlineNode], *, ports: bool = False, reasons: bool = False) -> str:
    """Return an outline as text, one line per node unless it is too long.

    Args:
        nodes: The outline.
        ports: True to list the inputs and outputs of every skill below it.
        reasons: True to list the failure reasons of every skill, and those that every catch handles.
    """
    lines = []
    for node, branch, below in zip(nodes, branches(nodes), children(nodes), strict=True):
        margin = branch.replace("├─", "│ ").replace("└─", "  ") + ("│  " if below else "   ")
        detail = f"  ({node.detail})" if node.detail else ""
        lines += _wrap(f"{node.name}{detail}", branch, margin)
        for sentence in _list_details(node, ports, reasons):
            lines += _wrap(sentence, margin, margin)
    return "\n".join(lines)


def describe_inputs(node: OutlineNode) -> str:
    """Return the variables that a skill reads, with `?` for one that may be unset; "" if none."""
    return "reads " + ", ".join(_format_connection(wire, "<-") for wire in node.reads) if node.reads else ""


def describe_outputs(node: OutlineNode) -> str:
    """Return the variables that a skill writes; "" if none."""
    return (
        "writes " + ", ".join(_format_connection(wire, "->") for wire in node.writes) if node.writes else ""
    )


def failure_reasons(node: OutlineNode) -> str:
    """Return the failure reasons of a skill; "" if it cannot fail."""
    return f"may fail: {', '.join(node.reasons)}" if node.reasons else ""


def branches(nodes: Sequence[OutlineNode]) -> list[str]:
    """Return the characters before each node that draw the lines to its parent."""
    joints = []
    # From the last node up: depths at which a later node has the same parent.
    more_follow: set[int] = set()
    for node in reversed(nodes):
        more_follow = {depth for depth in more_follow if depth <= node.depth}
        stem = "".join("│  " if depth in more_follow else "   " for depth in range(1, node.depth))
        joint = "" if node.depth == 0 else "├─ " if node.depth in more_follow else "└─ "
        joints.append(stem + joint)
        more_follow.add(node.depth)
    return joints[::-1]


def skills(nodes: Sequence[OutlineNode]) -> dict[str, str]:
    """Return the names of the leaves by path: the skills, which have no node below them.

    The role of a skill in its parent (`recover: Grasp`) is left out.
    """
    leaves = (node for node, below in zip(nodes, children(nodes), strict=True) if not below)
    return {node.path: node.name.rpartition(": ")[2] for node in leaves}


def fold_subtrees(nodes: Sequence[OutlineNode]) -> list[OutlineNode]:
    """Return an outline with every subtree once; each further use is a node with the name of the subtree."""
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


def open_running(nodes: Sequence[OutlineNode], running: Collection[str]) -> list[OutlineNode]:
    """Return the root, the running nodes and their children."""
    shown = []
    # True for each depth at which the last node is running.
    runs: list[bool] = []
    for node in nodes:
        del runs[node.depth :]
        if all(runs):
            shown.append(node)
        runs.append(node.path in running)
    return shown


def _wrap(text: str, first: str, other: str) -> list[str]:
    """Return a wrapped text, with prefixes for the first and for the other lines."""
    return textwrap.wrap(
        text, max(WIDTH, len(other) + _MIN_TEXT_WIDTH), initial_indent=first, subsequent_indent=f"{other}  ",
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip


def _list_details(node: OutlineNode, ports: bool, reasons: bool) -> Iterator[str]:
    """Yield the lines below a node."""
    if reasons and node.when:
        yield node.when
    if ports and (flow := "; ".join(filter(None, (describe_inputs(node), describe_outputs(node))))):
        yield flow
    if reasons and node.reasons:
        yield failure_reasons(node)


def _format_connection(wire: Connection, arrow: str) -> str:
    variable = f"${wire.variable}" + ("" if wire.required else "?")
    return variable if wire.port == wire.variable else f"{wire.port} {arrow} {variable}"


def _list_content(branch: Sequence[OutlineNode]) -> list[tuple[int, str, str]]:
    """Return depth, title and detail of each node, by which two uses of a subtree are compared."""
    return [(node.depth - branch[0].depth, node.title, node.detail) for node in branch]


def _make_use(node: OutlineNode, subtree: str, detail: str) -> OutlineNode:
    """Return the node that replaces a repeated subtree; the subtrees around it remain."""
    around = node.subtrees[: node.subtrees.index(subtree)]
    return OutlineNode(
        node.path, node.name, node.depth, detail, USE, subtree, node.slot, node.when, around, symbol="…",
        shape="ellipse",
    )  # fmt: skip
