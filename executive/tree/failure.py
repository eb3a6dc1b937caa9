"""Failures of nodes, and the reasons of failures in missions: `Skill.reason` and `label.reason`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Reason:
    """Reason of a failure with its source, written in a mission as `Grasp.missed`.

    Attributes:
        source: Name of a skill, keyword of a control node, or label of a node.
        reason: Reason as the source declares it, for instance `missed`.
    """

    source: str
    reason: str

    def __str__(self) -> str:
        return f"{self.source}.{self.reason}"


def format_reasons(reasons: Iterable[object]) -> str:
    """Return a text with all reasons, and with limits of counters: `Grasp.missed, look.unsure, placed: 4`."""
    return ", ".join(map(str, reasons))


@dataclass(frozen=True)
class Failure:
    """A failure with a declared reason, which nodes pass on to their parents.

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

    def matches(self, reasons: Iterable[Reason]) -> bool:
        """Return True if one of `reasons` denotes this failure."""
        sources = (self.source, *self.labels)
        return any(reason.reason == self.reason and reason.source in sources for reason in reasons)

    def with_label(self, label: str) -> Failure:
        """Return the failure with one more label, of a node that passed the failure on; "" adds no label."""
        return replace(self, labels=(*self.labels, label)) if label else self
