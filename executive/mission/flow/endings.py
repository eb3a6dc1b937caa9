"""The failures that no node of a mission handles: they can end the mission."""

from __future__ import annotations

from dataclasses import dataclass

from executive.mission.flow.analysis import Analysis


@dataclass(frozen=True)
class Ending:
    """A failure that ends the mission.

    Attributes:
        source: What fails: a skill, or a control node.
        reason: Its reason.
        node: Path of the node that fails.
        path: File in which that node is written.
        line: Its line there.
    """

    source: str
    reason: str
    node: str
    path: str
    line: int


def find_endings(flow: Analysis) -> tuple[Ending, ...]:
    """Return everything that can still end the mission, in the order of the tree."""
    order = {path: index for index, path in enumerate(flow.nodes)}
    found = sorted(flow.result.failures, key=lambda failure: (order[failure.origin], failure.reason))
    marks = {failure: flow.nodes[failure.origin].mark for failure in found}
    return tuple(
        Ending(failure.source, failure.reason, failure.origin, mark.source.path, mark.line)
        for failure, mark in marks.items()
    )
