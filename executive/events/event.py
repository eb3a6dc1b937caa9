"""Base class of the events, and an event with its time."""

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

    # Pydantic reads the events of a journal without type conversions.
    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(strict=True)


@dataclass(frozen=True)
class TimedEvent:
    """An event and its time.

    Attributes:
        tick: Control step in which the event happened.
        clock: Time on the clock of the run [s].
        event: The event.
    """

    tick: int
    clock: float
    event: Event


Emit = Callable[[Event], None]
"""Function that adds the time to an event and passes the timed event to all observers."""

Observer = Callable[[TimedEvent], None]
"""Function that receives an event in the thread of the tick loop, and returns at once."""


def discard_event(event: Event) -> None:
    """Ignore an event: the `emit` function of a part that has no observers."""
