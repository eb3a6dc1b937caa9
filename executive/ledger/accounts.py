"""Final state of each item after a run, and the balance of the counts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping

from executive.ledger.certainty import Certainty
from executive.ledger.item import LYING, REASON_NOT_FOUND, REASON_UNCERTAIN, REASON_UNTRACKED, Record, State

MIN_EMPTY_PROBES = 3
"""Number of times that the tool must find nothing but the table at an item's place to prove it a phantom."""
FINAL_STATES = (State.PLACED, State.REJECTED, State.SKIPPED, State.LOST)
"""Final states of an object; each item that was no phantom has one of them."""


def find_final_state(
    record: Record, certainty: Certainty, *, has_route: bool, completed: bool, touched_any: bool
) -> tuple[State, str] | None:
    """Return the final state of an item and its reason, or None if the item has its final state already.

    The first rule that applies decides:

    1. An item in the tool is rejected.
    2. An item with uncertain detections only, whose place no look has found empty, is rejected.
    3. An item that is likelier a false detection than an object is a phantom. So is an item that was detected
       repeatedly, if the tool reached the table at its place without a contact at least `MIN_EMPTY_PROBES`
       times, never touched it, and touched another item.
    4. An item that was dropped, or whose place was found empty, is lost; it is rejected if the tool may have
       moved it while nothing was recorded.
    5. An item without a route is skipped.
    6. If the mission was completed, an item that is sure, not contradicted and not attempted is skipped: a
       quota was reached, or the operator quit.
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
    """Set each lost item to PHANTOM if it is known as another item, and return those items.

    The other item certainly exists, is of the same class, and appeared at an empty place after the last
    detection of the lost item: somebody moved the object. Each such item explains one lost item. The tool
    held the items `dropped` after their last detection, so another item may have appeared before the drop.
    """
    lost = [record for record in records if record.state is State.LOST and record not in dropped]
    appeared = [
        record
        for record in records
        if record.has_appeared and record.belief.is_proved and record.state in FINAL_STATES
    ]
    found = []
    for old in lost:
        same = (new for new in appeared if new.label == old.label and new.first_stamp > old.stamp)
        if new := next(same, None):
            old.set_state(State.PHANTOM, f"it is {new.item}")
            appeared.remove(new)
            found.append(old)
    return found


def forget_rejected(records: Iterable[Record]) -> list[Record]:
    """Set each rejected or skipped item to PHANTOM, and return those items.

    Somebody may have moved the object. The next look creates a new item without earlier evidence.
    """
    left = [record for record in records if record.state in (State.REJECTED, State.SKIPPED)]
    for record in left:
        record.set_state(State.PHANTOM, "the run was resumed, and looks search for it again")
    return left


def count_states(records: Iterable[Record]) -> dict[str, int]:
    """Return the counts `seen, placed, rejected, skipped, lost, phantom`; phantoms are not among the seen."""
    states = Counter(record.state for record in records)
    return {
        "seen": sum(states.values()) - states[State.PHANTOM],
        **{state.value: states[state] for state in (*FINAL_STATES, State.PHANTOM)},
    }


def is_balanced(counts: Mapping[str, int]) -> bool:
    """Return True if each item that was seen is placed, rejected, skipped or lost."""
    return counts["seen"] == sum(counts[state.value] for state in FINAL_STATES)
