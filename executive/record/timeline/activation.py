"""Activations (executions) of a node."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

STATUS_TEXTS = {"SUCCESS": "done", "FAILURE": "failed", "INVALID": "halted", "RUNNING": "running"}
"""Text for each status, in the order of the texts in `format_counts`."""


@dataclass
class Activation:
    """One execution of a node, from its start to its end.

    Attributes:
        node: Path of the node.
        number: Number of this activation among all activations in the run, from 1.
        skill: Name of the skill; "" for a control node.
        item: Item that the skill works on, or "".
        status: `RUNNING`, `SUCCESS`, `FAILURE` or `INVALID`.
        start_tick, end_tick: Control steps of start and end; equal while the node is running.
        start, end: Times of start and end [s]; equal while the node is running.
        reason, message: Reason and message of the failure or fault, or "".
        choice: Last decision of a control node as text (`attempt 2 of 3`), or "".
        handled_counts: Number of failures that a control node handled, by name (`Grasp.missed`).
        message_by_reason: Last message of each handled failure, by name of the failure.
        last_handled_reason: Name of the last handled failure, or "".
        halted_skills: Paths of the skills that the control node halted before its end.
    """

    node: str
    number: int
    skill: str
    item: str
    status: str
    start_tick: int
    start: float
    end_tick: int
    end: float
    reason: str = ""
    message: str = ""
    choice: str = ""
    handled_counts: Counter[str] = field(default_factory=Counter)
    message_by_reason: dict[str, str] = field(default_factory=dict)
    last_handled_reason: str = ""
    halted_skills: tuple[str, ...] = ()

    @property
    def failure(self) -> str:
        """Text with the reason and the message of the failure, or ""."""
        return ": ".join(filter(None, (self.reason, self.message)))

    @property
    def reason_or_item(self) -> str:
        """Reason of the failure; without a failure, the name of the item."""
        return self.reason or self.item


def group_by_node(activations: Iterable[Activation]) -> dict[str, list[Activation]]:
    """Return the activations of each node, by path of the node."""
    activations_by_node: dict[str, list[Activation]] = {}
    for activation in activations:
        activations_by_node.setdefault(activation.node, []).append(activation)
    return activations_by_node


def format_counts(activations: Iterable[Activation]) -> str:
    """Return the number of activations with each status as text: `3 done, 1 failed`."""
    counts = Counter(activation.status for activation in activations)
    return ", ".join(f"{counts[status]} {text}" for status, text in STATUS_TEXTS.items() if counts[status])


def find_last_failure(activations: Sequence[Activation]) -> str:
    """Return reason and message of the last failed activation, or "" if no activation failed."""
    failures = (activation.failure for activation in reversed(activations) if activation.status == "FAILURE")
    return next(failures, "")


def get_skill_name(path: str) -> str:
    """Return the name or label of a skill from its path `.../name` or `.../key:name`."""
    return path.rpartition("/")[2].rpartition(":")[2]
