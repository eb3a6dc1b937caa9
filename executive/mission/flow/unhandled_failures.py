"""Failures that can end a mission, because no node handles them."""

from __future__ import annotations

from dataclasses import dataclass

from executive.mission.flow.analysis import FlowAnalysis


@dataclass(frozen=True)
class UnhandledFailure:
    """A failure that can end the mission.

    Attributes:
        source: Name of the skill, or keyword of the control node, that fails.
        reason: Reason of the failure.
        node: Path of the node that fails, in the tree.
        path: Path of the file that contains the node.
        line: Line of the node in the file.
    """

    source: str
    reason: str
    node: str
    path: str
    line: int


def find_unhandled_failures(flow: FlowAnalysis) -> tuple[UnhandledFailure, ...]:
    """Return the failures that can end the mission, in the order of the tree."""
    indices = {path: index for index, path in enumerate(flow.nodes)}
    failures = sorted(flow.result.failures, key=lambda failure: (indices[failure.origin], failure.reason))
    marks = {failure: flow.nodes[failure.origin].mark for failure in failures}
    return tuple(
        UnhandledFailure(failure.source, failure.reason, failure.origin, mark.source.path, mark.line)
        for failure, mark in marks.items()
    )
