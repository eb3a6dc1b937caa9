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


def find_unhandled_failures(analysis: FlowAnalysis) -> tuple[UnhandledFailure, ...]:
    """Return the failures that can end the mission, in the order of the tree."""
    order = {path: index for index, path in enumerate(analysis.nodes)}
    failures = list(analysis.root_flow.failures)
    failures.sort(key=lambda failure: (order[failure.origin], failure.reason))
    spans = {failure: analysis.nodes[failure.origin].span for failure in failures}
    return tuple(
        UnhandledFailure(failure.source, failure.reason, failure.origin, span.source.path, span.line)
        for failure, span in spans.items()
    )
