"""The accounts of a run that is over: the final state of each item, and their balance."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from executive.ledger.item import NOTHING, ON_TABLE, UNSURE, Record, State


def fate_of(record: Record, *, gone: bool, routed: bool) -> tuple[State, str] | None:
    """Return what became of an item and why, now that the run is over; None where it is settled already.

    An item seen where it was left is rejected, one that is known to exist and was not found again is lost,
    given up or not, and one that is likelier an invention than an object is a phantom. What looks were unsure
    of, and none has missed, may be an object: it is rejected.

    Args:
        record: The item.
        gone: Whether its place was searched in vain, as far as one can be sure.
        routed: Whether the mission has a bin for its class.
    """
    if record.state is State.HELD:
        return State.REJECTED, "still in the tool when the run ended"
    if record.state not in ON_TABLE:
        return None
    if record.state is State.SEEN and not record.looks and record.overlooked == 1.0:
        return State.REJECTED, UNSURE
    if record.probability < 0.5:
        return State.PHANTOM, NOTHING
    if record.state is State.DROPPED or gone:
        return State.LOST, "known to exist, not found again"
    if record.state is State.REJECTED:
        return None
    return State.REJECTED, "the run ended before its turn" if routed else "the mission has no route for it"


def balance(records: Iterable[Record]) -> dict[str, int]:
    """Return the counts `seen, placed, rejected, lost, phantom`; without the phantoms they are `seen`."""
    states = Counter(record.state for record in records)
    return {
        "seen": sum(states.values()) - states[State.PHANTOM],
        "placed": states[State.PLACED],
        "rejected": states[State.REJECTED],
        "lost": states[State.LOST],
        "phantom": states[State.PHANTOM],
    }
