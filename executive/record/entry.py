"""What the record says of an event: its stamp, and its data made plain."""

from __future__ import annotations

from typing import Any

from executive.events import Event
from executive.record.plain import plain

TRANSIENT = ("frame_object",)
"""Event data that only observers in this process can use."""

Entry = dict[str, Any]
"""`tick`, `clock`, `kind` and the data of one event as plain JSON; an object of the journal."""


def entry_of(event: Event) -> Entry:
    """Return the entry for `event`; its data cannot overwrite the stamp."""
    entry = {"tick": event.tick, "clock": plain(event.clock), "kind": event.kind}
    for key, value in event.data.items():
        if key not in TRANSIENT and key not in entry:
            entry[key] = plain(value)
    return entry
