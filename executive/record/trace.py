"""The trace: one short hash over every decision of a run. Equal traces mean equal runs."""

from __future__ import annotations

import hashlib
import json

from executive.events import Event
from executive.record.entry import Entry, entry_of

_DECIDING = {
    "status": ("node", "status", "reason", "item", "outputs"),
    "item": ("item", "state", "label", "position", "bin"),
    "decision": ("item", "label", "frame"),
}
"""What counts, by kind of event. Sentences do not: they may be reworded without changing what is done."""

_ENCODER = json.JSONEncoder(sort_keys=True, separators=(",", ":"), check_circular=False)


class Trace:
    """Hashes (tick, node path, status, reason, item, port values) as they happen.

    Wall time, paths and the run directory never enter it, so that the same mission, seed and weights
    give the same trace on the same kind of machine.
    """

    def __init__(self) -> None:
        self._hash = hashlib.sha256()

    def __call__(self, event: Event) -> None:
        """Take the entry for `event` into the hash; see `take`."""
        self.take(entry_of(event))

    def take(self, entry: Entry) -> None:
        """Take `entry` into the hash if it decides anything."""
        keys = _DECIDING.get(entry["kind"])
        if keys is not None:
            decision = [entry["tick"], entry["kind"], *map(entry.get, keys)]
            self._hash.update(_ENCODER.encode(decision).encode() + b"\n")

    def hexdigest(self) -> str:
        """Return the first 16 hexadecimal digits of the SHA-256 so far."""
        return self._hash.hexdigest()[:16]
