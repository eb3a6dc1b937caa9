"""Final states of the items at the end of a run, and a check that their counts add up."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping

from executive.ledger.certainty import Certainty
from executive.ledger.item import (
    ON_TABLE,
    REASON_NOT_FOUND,
    REASON_UNCERTAIN,
    REASON_UNTRACKED,
    Record,
    State,
)

MIN_EMPTY_PROBES = 3
"""Minimum number of descents that touch only the table at an item's position before it is a phantom."""
FINAL_STATES = (State.PLACED, State.REJECTED, State.SKIPPED, State.LOST)
"""Final states of real objects; an item without an object of its own ends as PHANTOM."""


def find_final_state(
    record: Record, certainty: Certainty, *, has_route: bool, is_completed: bool, has_touched_item: bool
) -> tuple[State, str] | None:
    """Return the final state of an item and the reason, or None if the present state is final.

    The first rule that applies determines the state:

    1. An item in the tool is rejected.
    2. An item with low-confidence detections only, which no look has missed, is rejected.
    3. An item whose probability of existence is below 0.5 is a phantom. So is an item if the tool reached the
       table at the item's position without a contact at least `MIN_EMPTY_PROBES` times, never touched the
       item, and touched another item.
    4. A dropped item that the tool may have moved while the journal was incomplete is rejected. Any other
       dropped item, and an item that looks have missed repeatedly, is lost.
    5. An item without a route is skipped.
    6. If the mission was completed, a certain item without contradiction and failed attempt is skipped: a
       quota was reached, or the operator quit.
    7. Any other item is rejected.

    Args:
        record: The item.
        certainty: Rules for certain items.
        has_route: True if the mission has a bin for the item's class.
        is_completed: True if the behaviour tree succeeded.
        has_touched_item: True if the tool has touched any item at the height of the item's class.
    """
    belief = record.belief
    if record.state is State.HELD:
        return State.REJECTED, "still in the tool when the run ended"
    if record.state not in (*ON_TABLE, State.DROPPED):
        return None
    if record.state is State.SEEN and not belief.look_count and belief.miss_probability == 1.0:
        return State.REJECTED, REASON_UNCERTAIN
    if belief.existence_probability < 0.5:
        return State.PHANTOM, REASON_NOT_FOUND
    if record.empty_probe_count >= MIN_EMPTY_PROBES and has_touched_item and not record.had_contact:
        reason = f"the tool found only the table at its position, {record.empty_probe_count} times"
        return State.PHANTOM, reason
    if record.state is State.DROPPED and record.is_untracked:
        return State.REJECTED, REASON_UNTRACKED
    if record.state is State.DROPPED or certainty.is_position_empty(record):
        return State.LOST, "known to exist, not found again"
    if record.state is State.REJECTED:
        return None
    if not has_route:
        return State.SKIPPED, "the mission has no route for it"
    had_problem = record.attempt_count or record.last_contradiction
    if is_completed and certainty.is_certain(record) and not had_problem:
        return State.SKIPPED, "the mission was completed without it"
    return State.REJECTED, "the run ended before its turn"


def discard_moved_items(records: Collection[Record], dropped: Collection[Record]) -> list[Record]:
    """Set each lost item that a person moved, and that is another item now, to PHANTOM; return the phantoms.

    The other item certainly exists, has the same class, and appeared at an empty position after the last
    detection of the lost item. Each other item explains one lost item. Items in `dropped` never count as
    moved: the tool held them after their last detection, so that the other item may have appeared before.
    """
    appeared = [
        record
        for record in records
        if record.appeared_during_run and record.belief.is_proved and record.state in FINAL_STATES
    ]
    phantoms = []
    for old in records:
        if old.state is State.LOST and old not in dropped:
            matches = (new for new in appeared if new.label == old.label and new.first_stamp > old.stamp)
            if new := next(matches, None):
                old.set_state(State.PHANTOM, f"it is {new.item}")
                appeared.remove(new)
                phantoms.append(old)
    return phantoms


def discard_rejected_items(records: Iterable[Record]) -> list[Record]:
    """Set each rejected or skipped item to PHANTOM, and return these items.

    A person may have moved the objects before the run is resumed. The next look adds new items for them,
    without the earlier evidence.
    """
    phantoms = [record for record in records if record.state in (State.REJECTED, State.SKIPPED)]
    for record in phantoms:
        record.set_state(State.PHANTOM, "the run was resumed, and the next look adds its object again")
    return phantoms


def count_states(records: Iterable[Record]) -> dict[str, int]:
    """Return item counts: `seen` (no phantoms), `placed`, `rejected`, `skipped`, `lost` and `phantom`."""
    counts = Counter(record.state for record in records)
    return {
        "seen": sum(counts.values()) - counts[State.PHANTOM],
        **{state.value: counts[state] for state in (*FINAL_STATES, State.PHANTOM)},
    }


def is_balanced(counts: Mapping[str, int]) -> bool:
    """Return True if `seen` is the sum of `placed`, `rejected`, `skipped` and `lost`."""
    return counts["seen"] == sum(counts[state.value] for state in FINAL_STATES)
