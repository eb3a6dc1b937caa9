"""Text of a tree, as a person reads it in a terminal."""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Iterator, Sequence

from executive.mission.model.grammar import USE
from executive.mission.outline import Connection, OutlineNode, children

WIDTH = 100
"""Where long lines are wrapped [columns]."""

_LEAST = 40


def drawn(nodes: Sequence[OutlineNode], *, ports: bool = False, reasons: bool = False) -> str:
    """Return an outline as text, one line per node where it is not too long.

    Args:
        nodes: The outline.
        ports: Say below every skill which variables it reads and writes.
        reasons: Say below every skill why it may fail, and below every catch which failures it is for.
    """
    lines = []
    for node, branch, below in zip(nodes, branches(nodes), children(nodes), strict=True):
        margin = branch.replace("├─", "│ ").replace("└─", "  ") + ("│  " if below else "   ")
        detail = f"  ({node.detail})" if node.detail else ""
        lines += _wrapped(f"{node.name}{detail}", branch, margin)
        for sentence in _said_below(node, ports, reasons):
            lines += _wrapped(sentence, margin, margin)
    return "\n".join(lines)


def reads(node: OutlineNode) -> str:
    """Return which variables a skill reads, with `?` where one may be unset; "" if none."""
    return "reads " + ", ".join(_wire(wire, "<-") for wire in node.reads) if node.reads else ""


def writes(node: OutlineNode) -> str:
    """Return which variables a skill writes; "" if none."""
    return "writes " + ", ".join(_wire(wire, "->") for wire in node.writes) if node.writes else ""


def why(node: OutlineNode) -> str:
    """Return why a skill may fail; "" if it cannot."""
    return f"may fail: {', '.join(node.reasons)}" if node.reasons else ""


def branches(nodes: Sequence[OutlineNode]) -> list[str]:
    """Return what joins each node to its parent when the tree is drawn."""
    joints = []
    # From the last node up: at which depths does a later node hang from the same parent?
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

    What a skill is to its parent (`recover: Grasp`) is left out.
    """
    leaves = (node for node, below in zip(nodes, children(nodes), strict=True) if not below)
    return {node.path: node.name.rpartition(": ")[2] for node in leaves}


def folded(nodes: Sequence[OutlineNode]) -> list[OutlineNode]:
    """Return an outline in which every subtree is shown once; where it is used again stands its name."""
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
            first |= {subtree: _content(branch) for subtree in node.subtrees}
            shown.append(node)
            index += 1
        else:
            same = first[known] == _content(branch)
            shown.append(_use(node, known, "as above" if same else "as above, other params"))
            index = end
    return shown


def opened(nodes: Sequence[OutlineNode], running: Collection[str]) -> list[OutlineNode]:
    """Return the root and what stands directly below a running node; what rests stays folded."""
    shown = []
    # Whether the last node met at each depth is running, and with it everything above.
    runs: list[bool] = []
    for node in nodes:
        del runs[node.depth :]
        if all(runs):
            shown.append(node)
        runs.append(node.path in running)
    return shown


def _wrapped(text: str, first: str, other: str) -> list[str]:
    """Return a text in lines that are not too long, after what stands before the first and the others."""
    return textwrap.wrap(
        text, max(WIDTH, len(other) + _LEAST), initial_indent=first, subsequent_indent=f"{other}  ",
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip


def _said_below(node: OutlineNode, ports: bool, reasons: bool) -> Iterator[str]:
    """Yield what is said below a node."""
    if reasons and node.when:
        yield node.when
    if ports and (flow := "; ".join(filter(None, (reads(node), writes(node))))):
        yield flow
    if reasons and node.reasons:
        yield why(node)


def _wire(wire: Connection, arrow: str) -> str:
    variable = f"${wire.variable}" + ("" if wire.required else "?")
    return variable if wire.port == wire.variable else f"{wire.port} {arrow} {variable}"


def _content(branch: Sequence[OutlineNode]) -> list[tuple[int, str, str]]:
    """Return what tells two uses of a subtree from each other."""
    return [(node.depth - branch[0].depth, node.title, node.detail) for node in branch]


def _use(node: OutlineNode, subtree: str, detail: str) -> OutlineNode:
    """Return what stands for a subtree that begins with this node; those around it stay what they are."""
    around = node.subtrees[: node.subtrees.index(subtree)]
    return OutlineNode(
        node.path, node.name, node.depth, detail, USE, subtree, node.slot, node.when, around, symbol="…",
        shape="ellipse",
    )  # fmt: skip
