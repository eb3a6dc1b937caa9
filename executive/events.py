"""What a run tells its observers: one flat record per thing that happened."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Exact:
    """A value of an event that is kept as it is, to the last bit.

    Attributes:
        value: Plain JSON already: None, truth values, finite numbers, texts, lists, and mappings with texts
            as keys.
    """

    value: Any


@dataclass(frozen=True)
class Event:
    """One thing that happened in a run.

    Attributes:
        kind: What sort of thing, from a small set: `run`, `status`, `intent`, `item`, `look`,
            `asking`, `request`, `decision`, `choice`, `plan`, `sense`, `halt`, `resume`, `disturbance`,
            `fault`, `end`.
        tick: Control step at which it happened.
        clock: Time on the run's clock [s].
        data: Plain values (numbers, texts, lists, mappings) that describe it.
    """

    kind: str
    tick: int
    clock: float
    data: Mapping[str, Any] = field(default_factory=dict)


Observer = Callable[[Event], None]
"""Takes an event on the tick thread and returns at once."""

Emit = Callable[..., None]
"""`emit(kind, **data)`: stamps an event with tick and clock and hands it to every observer."""


def ignore(kind: str, **data: Any) -> None:
    """Take an event and do nothing: the `emit` of a part that nobody observes."""
