"""A tree's outline as a person reads it in a terminal."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from executive.mission.outline import OutlineNode


def drawn(nodes: Sequence[OutlineNode]) -> str:
    """Return an outline as text, one line per node."""
    lines = []
    for node, branch in zip(nodes, branches(nodes), strict=True):
        detail = f"  ({node.detail})" if node.detail else ""
        lines.append(f"{branch}{node.name}{detail}")
    return "\n".join(lines)


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
    next_depths = [*(node.depth for node in nodes[1:]), 0]
    return {
        node.path: node.name.rpartition(": ")[2]
        for node, next_depth in zip(nodes, next_depths, strict=True)
        if next_depth <= node.depth
    }


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
