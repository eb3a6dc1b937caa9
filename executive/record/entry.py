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
    """Return the entry for `event`; its data cannot overwrite the stamp.

    What cannot be made plain, such as a list that holds itself, is told by the name of its type.
    """
    entry = {"tick": event.tick, "clock": plain(event.clock), "kind": event.kind}
    for key, value in event.data.items():
        if key not in TRANSIENT and key not in entry:
            try:
                entry[key] = plain(value)
            except Exception:
                # A skill hands on values of any type: one that misbehaves must not cost the record.
                entry[key] = type(value).__name__
    return entry
