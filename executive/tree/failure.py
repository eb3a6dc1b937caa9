"""Failures of nodes, and the names by which missions refer to them: `Skill.reason` and `label.reason`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Reason:
    """Name by which a mission refers to failures: `Grasp.missed`.

    Attributes:
        source: Name of a skill, keyword of a control node, or label of a node.
        reason: Declared cause of a failure of the source.
    """

    source: str
    reason: str

    def __str__(self) -> str:
        return f"{self.source}.{self.reason}"


@dataclass(frozen=True)
class Failure:
    """A failure with a declared reason, which is propagated up the tree.

    Attributes:
        reason: One of the declared reasons of the skill or of the control node.
        message: One sentence with the measured values that explain the failure.
        source: Name of the skill, or the keyword of the control node, that failed.
        path: Path of the node that failed.
        labels: Labels of the failed node and of the ancestors that passed the failure on.
    """

    reason: str
    message: str
    source: str
    path: str
    labels: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"{self.source}.{self.reason}"

    def matches(self, names: Iterable[Reason]) -> bool:
        """Return True if one of the names denotes this failure."""
        return any(
            name.reason == self.reason and (name.source == self.source or name.source in self.labels)
            for name in names
        )

    def with_label(self, label: str) -> Failure:
        """Return the failure as passed on by a node with this label; "" for a node without label."""
        return replace(self, labels=(*self.labels, label)) if label else self
