"""Base of the events, and an event with its time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from pydantic import ConfigDict


@dataclass(frozen=True)
class Event:
    """Base of the events.

    Attributes:
        is_recorded: True if the journal holds the events of this kind.
    """

    is_recorded: ClassVar[bool] = True

    # Pydantic validates the events of a journal without converting types.
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
"""Function that receives an event on the tick thread and returns at once."""


def discard_event(event: Event) -> None:
    """Do nothing: the `emit` of a part without observers."""
