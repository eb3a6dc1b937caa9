"""Texts of one node in a drawing of a tree."""

from __future__ import annotations

from dataclasses import dataclass

from executive.mission.outline import OutlineNode
from executive.tree.node import ControlNode
from executive.view.text import fitted
from executive.view.tree.outline import describe_inputs, describe_outputs, failure_reasons

COLUMNS = 28
"""Length of a node's lines [characters]."""


@dataclass(frozen=True)
class Card:
    """Texts of a node in a drawing.

    Attributes:
        symbol: Symbol before the title of a control node; "" for a skill.
        title: Its name.
        lines: Its condition and its details in the mission, shortened.
        tooltip: All facts about it, one per line.
    """

    symbol: str
    title: str
    lines: tuple[str, ...]
    tooltip: str


def card(node: OutlineNode) -> Card:
    """Return the texts of a node."""
    symbol = "" if node.kind == "skill" else node.symbol or ControlNode.symbol
    title = "".join(fitted(node.title, COLUMNS))
    lines = fitted(node.when, COLUMNS, 2) + fitted(node.detail, COLUMNS, 3 if symbol else 2)
    return Card(symbol, title, lines, "\n".join(_list_facts(node)))


def _list_facts(node: OutlineNode) -> list[str]:
    """Return all facts about a node, the most important first."""
    word = node.skill or node.kind
    facts = (
        node.title if node.title == word else f"{node.title}: {word}",
        node.doc,
        node.when,
        node.detail,
        describe_inputs(node),
        describe_outputs(node),
        failure_reasons(node),
        f"subtree {node.subtree}" if node.subtrees else "",
        node.path,
    )
    return [fact for fact in facts if fact]
