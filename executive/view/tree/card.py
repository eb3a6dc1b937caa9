"""What a picture of a tree says of one node."""

from __future__ import annotations

from dataclasses import dataclass

from executive.mission.outline import OutlineNode
from executive.tree.node import ControlNode
from executive.view.text import fitted
from executive.view.tree.outline import reads, why, writes

COLUMNS = 28
"""Length of a node's lines [characters]."""


@dataclass(frozen=True)
class Card:
    """A node in a picture.

    Attributes:
        symbol: What stands before the title of a control node; "" for a skill.
        title: Its name.
        lines: What the mission says about it, shortened.
        tooltip: Everything about it, one fact a line.
    """

    symbol: str
    title: str
    lines: tuple[str, ...]
    tooltip: str


def card(node: OutlineNode) -> Card:
    """Return what a picture says of a node."""
    symbol = "" if node.kind == "skill" else node.symbol or ControlNode.symbol
    title = "".join(fitted(node.title, COLUMNS))
    lines = fitted(node.when, COLUMNS, 2) + fitted(node.detail, COLUMNS, 3 if symbol else 2)
    return Card(symbol, title, lines, "\n".join(_facts(node)))


def _facts(node: OutlineNode) -> list[str]:
    """Return everything there is to say about a node, most important first."""
    word = node.skill or node.kind
    facts = (
        node.title if node.title == word else f"{node.title}: {word}",
        node.doc,
        node.when,
        node.detail,
        reads(node),
        writes(node),
        why(node),
        f"subtree {node.subtree}" if node.subtrees else "",
        node.path,
    )
    return [fact for fact in facts if fact]
