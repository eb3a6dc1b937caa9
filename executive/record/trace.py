"""Trace of a run: a hash of all its decisions for the comparison of runs."""

from __future__ import annotations

import hashlib
import json

from executive.events import ItemChanged, NodeEnded, NodeStarted, TargetSelected, TimedEvent

_ENCODER = json.JSONEncoder(sort_keys=True, separators=(",", ":"), check_circular=False)
"""Encoder with a unique text for each value, so that equal decisions have equal hashes."""


class Trace:
    """Hash of the starts and ends of nodes, the changes of items and the selected targets, with their ticks.

    Wall times, messages and paths of files are not hashed, so that the same mission, seed and weights of
    detectors give the same trace on the same kind of processor.
    """

    def __init__(self) -> None:
        self._hash = hashlib.sha256()

    def __call__(self, timed: TimedEvent) -> None:
        """Add an event to the hash if it is a decision."""
        event = timed.event
        match event:
            case NodeStarted(node, skill, item):
                decision = ["status", node, "RUNNING", *(("", item) if skill else (None, None)), None]
            case NodeEnded(node, status, skill):
                details = (event.reason, event.item) if skill else (event.reason or None, None)
                decision = ["status", node, status, *details, event.outputs]
            case ItemChanged(item, label, state, position):
                decision = ["item", item, state, label, position, event.bin]
            case TargetSelected(item, label, frame):
                decision = ["decision", item, label, frame]
            case _:
                return
        self._hash.update(_ENCODER.encode([timed.tick, *decision]).encode() + b"\n")

    def hexdigest(self) -> str:
        """Return the first 16 hexadecimal digits of the SHA-256 of all decisions up to now."""
        return self._hash.hexdigest()[:16]
