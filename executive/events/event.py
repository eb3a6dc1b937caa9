"""Base class of events, and the functions that emit and observe events."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from pydantic import ConfigDict


@dataclass(frozen=True)
class Event:
    """Base class of the events.

    Attributes:
        is_recorded: True if events of this class are written to the journal.
    """

    is_recorded: ClassVar[bool] = True

    # Pydantic rejects a journal in which a field has another type, instead of converting the value.
    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(strict=True)


@dataclass(frozen=True)
class TimedEvent:
    """An event and its time.

    Attributes:
        tick: Number of the control step in which the event happened.
        clock: Time on the clock of the run [s].
        event: The event.
    """

    tick: int
    clock: float
    event: Event


Emit = Callable[[Event], None]
"""Function that emits an event: adds the time, and passes the timed event to all observers."""

Observer = Callable[[TimedEvent], None]
"""Function that receives a timed event in the thread of the tick loop, and returns without waiting."""


def discard_event(event: Event) -> None:
    """Ignore an event; serves as the `Emit` function if nobody observes the events."""
