"""Executions of a node, and the values that were read from the cell before a failure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

_STATUS_TEXTS = {"SUCCESS": "done", "FAILURE": "failed", "INVALID": "halted", "RUNNING": "running"}


@dataclass(frozen=True)
class Reading:
    """Number, truth value or string that was read from the cell.

    Attributes:
        name: Name of the input.
        value: The value, or the message of the exception.
        raised: Name of the exception that the cell raised; "" for a value.
        tick: Control step in which this value was read first.
        clock: Time of this control step [s].
    """

    name: str
    value: bool | int | float | str
    raised: str
    tick: int
    clock: float


@dataclass
class Activation:
    """One execution of a node, from its start to its end.

    Attributes:
        node: Path of the node.
        number: Number of this activation among all activations in the run, from 1.
        skill: Name of the skill; "" for a control node.
        item: Item that the skill works on, or "".
        status: `RUNNING`, `SUCCESS`, `FAILURE` or `INVALID`.
        start_tick, end_tick: Control steps of start and end; equal while the node runs.
        start, end: Times of start and end [s]; equal while the node runs.
        reason, message: Reason and message of the failure or fault, or "".
        choice: Last decision of a control node, or "".
        handled_counts: Number of failures that a control node handled, by reason.
        message_by_reason: Message of the last handled failure, by reason.
        last_handled_reason: Reason of the last handled failure, or "".
        halted: Paths of the skills that the control node halted before it ended.
        readings: Last value of each input before the failure of a skill, the latest at the end.
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
    halted: tuple[str, ...] = ()
    readings: tuple[Reading, ...] = ()

    @property
    def failure(self) -> str:
        """Reason and message of the failure, or ""."""
        return ": ".join(filter(None, (self.reason, self.message)))

    @property
    def note(self) -> str:
        """Reason of the failure, or else name of the item."""
        return self.reason or self.item


def group_by_node(activations: Iterable[Activation]) -> dict[str, list[Activation]]:
    """Return the activations of each node by its path."""
    activations_by_node: dict[str, list[Activation]] = {}
    for activation in activations:
        activations_by_node.setdefault(activation.node, []).append(activation)
    return activations_by_node


def describe_ends(activations: Iterable[Activation]) -> str:
    """Return a text with the number of activations in each status: `3 done, 1 failed`."""
    counts = Counter(activation.status for activation in activations)
    return ", ".join(f"{counts[status]} {text}" for status, text in _STATUS_TEXTS.items() if counts[status])


def find_last_failure(activations: Sequence[Activation]) -> str:
    """Return reason and message of the last failed activation, or "" if no activation failed."""
    failures = (activation.failure for activation in reversed(activations) if activation.status == "FAILURE")
    return next(failures, "")


def to_skill_name(path: str) -> str:
    """Return the name or label of the skill in the node at `path`."""
    return path.rpartition("/")[2].rpartition(":")[2]
