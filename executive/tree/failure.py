"""Why a node failed, in the words a mission matches: `Skill.reason` or `label.reason`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Failure:
    """A declared failure on its way up the tree.

    Attributes:
        reason: One of the skill's declared reasons, or the control node's own: `timeout`, `inverted`.
        message: One sentence with numbers.
        source: Name of the skill, or the word of the control node, that failed.
        path: Path of the node that failed.
        labels: Labels of that node and of the nodes above it that passed the failure on.
    """

    reason: str
    message: str
    source: str
    path: str
    labels: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"{self.source}.{self.reason}"

    def matches(self, names: Iterable[tuple[str, str]]) -> bool:
        """Tell whether one of the `(skill or label, reason)` pairs means this failure."""
        return any(
            reason == self.reason and (source == self.source or source in self.labels)
            for source, reason in names
        )

    def seen_from(self, label: str) -> Failure:
        """Return the failure as it leaves a node with this label ("" for none)."""
        return replace(self, labels=(*self.labels, label)) if label else self
