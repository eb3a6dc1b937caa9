"""Execution of a node, and the answers of the cell before it failed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

_WORDS = {"SUCCESS": "done", "FAILURE": "failed", "INVALID": "halted", "RUNNING": "under way"}


@dataclass(frozen=True)
class Reading:
    """Answer of the cell that is a number, a truth value or a text.

    Attributes:
        name: Name of the input.
        value: The answer, or the message of the exception.
        raised: Name of the exception that the cell raised; "" for an answer.
        tick: Control step in which the answer was read first.
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
        number: Number of the activation in the run, from 1.
        skill: Name of the skill; "" for a control node.
        item: Item that the skill works on, or "".
        status: `RUNNING`, `SUCCESS`, `FAILURE` or `INVALID`.
        start_tick, end_tick: Control steps of start and end; the end is the start while the node runs.
        start, end: Times of start and end [s].
        reason, message: Reason and message of the failure or fault, or "".
        choice: Last decision of a control node.
        handled: Number of failures that a control node has handled, by reason.
        messages: Message of the last handled failure, by reason.
        last_handled: Reason of the failure that was handled last, or "".
        halted: Paths of the skills that the control node halted just before it ended.
        readings: Last answers of the cell when the skill failed, the latest at the end.
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
    handled: Counter[str] = field(default_factory=Counter)
    messages: dict[str, str] = field(default_factory=dict)
    last_handled: str = ""
    halted: tuple[str, ...] = ()
    readings: tuple[Reading, ...] = ()

    @property
    def failure(self) -> str:
        """Reason and message of the failure, or ""."""
        return ": ".join(filter(None, (self.reason, self.message)))

    @property
    def note(self) -> str:
        """Reason of the failure, else the item."""
        return self.reason or self.item


def group_by_node(activations: Iterable[Activation]) -> dict[str, list[Activation]]:
    """Return the activations of each node by its path."""
    grouped: dict[str, list[Activation]] = {}
    for activation in activations:
        grouped.setdefault(activation.node, []).append(activation)
    return grouped


def count_ends(activations: Iterable[Activation]) -> str:
    """Return the number of activations for each status in words: `3 done, 1 failed`."""
    ends = Counter(activation.status for activation in activations)
    return ", ".join(f"{ends[status]} {word}" for status, word in _WORDS.items() if ends[status])


def find_last_failure(activations: Sequence[Activation]) -> str:
    """Return reason and message of the last activation that failed; "" if none failed."""
    failures = (activation.failure for activation in reversed(activations) if activation.status == "FAILURE")
    return next(failures, "")


def skill_name(path: str) -> str:
    """Return the name or label of the skill at the end of the path of a node."""
    return path.rpartition("/")[2].rpartition(":")[2]
