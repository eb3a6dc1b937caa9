"""Checks of the names that a mission gives its nodes with `as:`."""

from __future__ import annotations

from collections.abc import Iterator

from executive.mission.check.case import Case
from executive.mission.findings import Finding, error
from executive.mission.model import grammar
from executive.mission.source import Mark

_SLOTS = ("do", "recover", "condition", "catch", "finally")
"""What nodes are to their parents; paths are made of these words too."""


def labels(case: Case) -> Iterator[Finding]:
    """Find every label that stands for two nodes, or is a word of the language."""
    first: dict[str, Mark] = {}
    for node in case.nodes():
        if not node.label:
            continue
        mark = node.label_mark or node.mark
        if node.label in grammar.CONTROL or node.label in _SLOTS:
            message = f'"{node.label}" is a word of the language and cannot be a label'
            yield error(mark, "bad-label", message)
        # The same place twice is one node of a subtree that is used twice.
        other = first.setdefault(node.label, mark)
        if other != mark:
            message = (
                f'the label "{node.label}" stands for two nodes; the first is in {other.place(mark.source)}'
            )
            yield error(mark, "duplicate-label", message)
