"""Texts about a node in a picture of a tree."""

from __future__ import annotations

from dataclasses import dataclass

from executive.mission.outline import OutlineNode
from executive.tree.node import ControlNode
from executive.view.text import wrap_and_truncate
from executive.view.tree.tree_text import describe_connections, describe_reasons

MAX_LINE_LENGTH = 28
"""Maximum length of a line of text in the box of a node [characters]."""


@dataclass(frozen=True)
class NodeTexts:
    """Texts about a node in a picture of a tree.

    Attributes:
        symbol: Symbol before the title of a control node; "" for a skill.
        title: Name of the node, truncated to `MAX_LINE_LENGTH`.
        lines: Settings of the node in the mission; for a catch, first the failures that start the catch.
        tooltip: All information about the node, with one line per topic.
    """

    symbol: str
    title: str
    lines: tuple[str, ...]
    tooltip: str


def make_node_texts(node: OutlineNode) -> NodeTexts:
    """Return the texts about a node in a picture."""
    symbol = "" if node.kind == "skill" else node.symbol or ControlNode.symbol
    title = "".join(wrap_and_truncate(node.title, MAX_LINE_LENGTH))
    trigger_lines = wrap_and_truncate(node.trigger, MAX_LINE_LENGTH, 2)
    detail_lines = wrap_and_truncate(node.detail, MAX_LINE_LENGTH, 3 if symbol else 2)
    return NodeTexts(symbol, title, trigger_lines + detail_lines, _make_tooltip(node))


def _make_tooltip(node: OutlineNode) -> str:
    """Return all information about a node, with the most important line first."""
    type_name = node.skill or node.kind
    lines = (
        node.title if node.title == type_name else f"{node.title}: {type_name}",
        node.doc,
        node.trigger,
        node.detail,
        *describe_connections(node),
        describe_reasons(node),
        f"subtree {node.joined_subtrees}" if node.subtrees else "",
        node.path,
    )
    return "\n".join(filter(None, lines))
