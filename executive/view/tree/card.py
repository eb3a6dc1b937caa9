"""Texts that a picture of a tree shows for a node."""

from __future__ import annotations

from dataclasses import dataclass

from executive.mission.outline import OutlineNode
from executive.tree.node import ControlNode
from executive.view.text import fit_text
from executive.view.tree.tree_text import describe_reads, describe_reasons, describe_writes

MAX_LINE_LENGTH = 28
"""Maximum length of a line of text in the box of a node [characters]."""


@dataclass(frozen=True)
class Card:
    """Texts that a picture of a tree shows for a node.

    Attributes:
        symbol: Symbol before the title of a control node; "" for a skill.
        title: Name of the node, truncated.
        lines: Failures after which the node runs, and params from the mission, truncated.
        tooltip: All facts about the node, one per line.
    """

    symbol: str
    title: str
    lines: tuple[str, ...]
    tooltip: str


def make_card(node: OutlineNode) -> Card:
    """Return the texts that a picture shows for a node."""
    symbol = "" if node.kind == "skill" else node.symbol or ControlNode.symbol
    title = "".join(fit_text(node.title, MAX_LINE_LENGTH))
    lines = fit_text(node.when, MAX_LINE_LENGTH, 2) + fit_text(
        node.detail, MAX_LINE_LENGTH, 3 if symbol else 2
    )
    return Card(symbol, title, lines, "\n".join(_list_facts(node)))


def _list_facts(node: OutlineNode) -> list[str]:
    """Return texts with all facts about a node, the most important first."""
    type_name = node.skill or node.kind
    facts = (
        node.title if node.title == type_name else f"{node.title}: {type_name}",
        node.doc,
        node.when,
        node.detail,
        describe_reads(node),
        describe_writes(node),
        describe_reasons(node),
        f"subtree {node.subtree}" if node.subtrees else "",
        node.path,
    )
    return [fact for fact in facts if fact]
