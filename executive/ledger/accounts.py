"""Final state of each item after a run, and the balance of the counts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping

from executive.ledger.certainty import Certainty
from executive.ledger.item import LYING, REASON_NOT_FOUND, REASON_UNCERTAIN, REASON_UNTRACKED, Record, State

MIN_EMPTY_PROBES = 3
"""Number of probes that find only the table at an item's place, from which the item may be a phantom."""
FINAL_STATES = (State.PLACED, State.REJECTED, State.SKIPPED, State.LOST)
"""Final states of an object; each item that is no phantom gets one of these states."""


def find_final_state(
    record: Record, certainty: Certainty, *, has_route: bool, completed: bool, touched_any: bool
) -> tuple[State, str] | None:
    """Return the final state of an item and its reason, or None if the item has its final state already.

    The first rule that applies decides:

    1. An item in the tool is rejected.
    2. An item with low-confidence detections only, whose place no look has found empty, is rejected.
    3. An item that is likelier a false detection than an object is a phantom. So is an item if the tool
       reached the table at its place without a contact at least `MIN_EMPTY_PROBES` times, never touched the
       item, and touched another item.
    4. A dropped item that the tool may have moved while nothing was recorded is rejected. Another dropped
       item, or an item whose place was found empty, is lost.
    5. An item without a route is skipped.
    6. If the mission was completed, a certain item without contradiction and attempts is skipped: a quota was
       reached, or the operator quit.
    7. Any other item is rejected.

    Args:
        record: The item.
        certainty: Rules by which an item is certain.
        has_route: True if the mission has a bin for its class.
        completed: True if the behaviour tree succeeded.
        touched_any: True if the tool has touched any item at the height of its class.
    """
    belief = record.belief
    if record.state is State.HELD:
        return State.REJECTED, "still in the tool when the run ended"
    if record.state not in (*LYING, State.DROPPED):
        return None
    if record.state is State.SEEN and not belief.looks and belief.miss_probability == 1.0:
        return State.REJECTED, REASON_UNCERTAIN
    if belief.probability < 0.5:
        return State.PHANTOM, REASON_NOT_FOUND
    if record.empty_probes >= MIN_EMPTY_PROBES and touched_any and not record.had_contact:
        return State.PHANTOM, f"the tool found only the table at its place, {record.empty_probes} times"
    if record.state is State.DROPPED and record.is_untracked:
        return State.REJECTED, REASON_UNTRACKED
    if record.state is State.DROPPED or certainty.is_gone(record):
        return State.LOST, "known to exist, not found again"
    if record.state is State.REJECTED:
        return None
    if not has_route:
        return State.SKIPPED, "the mission has no route for it"
    if completed and certainty.is_sure(record) and not (record.attempts or record.contradiction):
        return State.SKIPPED, "the mission was completed without it"
    return State.REJECTED, "the run ended before its turn"


def find_lost_elsewhere(records: Collection[Record], dropped: Collection[Record]) -> list[Record]:
    """Set each lost item to PHANTOM if a person moved it and another item shows it; return these phantoms.

    The other item is proved, has the same class, and appeared at an empty place after the last detection of
    the lost item. Each other item explains one lost item. Items in `dropped` do not count as moved by a
    person: the tool held them after their last detection, so the other item may have appeared before.
    """
    appeared = [
        record
        for record in records
        if record.has_appeared and record.belief.is_proved and record.state in FINAL_STATES
    ]
    phantoms = []
    for old in records:
        if old.state is State.LOST and old not in dropped:
            same = (new for new in appeared if new.label == old.label and new.first_stamp > old.stamp)
            if new := next(same, None):
                old.set_state(State.PHANTOM, f"it is {new.item}")
                appeared.remove(new)
                phantoms.append(old)
    return phantoms


def forget_rejected(records: Iterable[Record]) -> list[Record]:
    """Set each rejected or skipped item to PHANTOM, and return these items.

    A person may have moved the object. The next look creates a new item without earlier evidence.
    """
    phantoms = [record for record in records if record.state in (State.REJECTED, State.SKIPPED)]
    for record in phantoms:
        record.set_state(State.PHANTOM, "the run was resumed, and looks search for it again")
    return phantoms


def count_states(records: Iterable[Record]) -> dict[str, int]:
    """Return the counts `seen, placed, rejected, skipped, lost, phantom`; `seen` excludes phantoms."""
    states = Counter(record.state for record in records)
    return {
        "seen": sum(states.values()) - states[State.PHANTOM],
        **{state.value: states[state] for state in (*FINAL_STATES, State.PHANTOM)},
    }


def is_balanced(counts: Mapping[str, int]) -> bool:
    """Return True if `seen` is the sum of `placed`, `rejected`, `skipped` and `lost`."""
    return counts["seen"] == sum(counts[state.value] for state in FINAL_STATES)
