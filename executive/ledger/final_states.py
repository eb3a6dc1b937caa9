"""Final state of each item at the end of a run."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

from executive.ledger.bin_contents import REASON_PROBABLY_FELL, find_probable_bin
from executive.ledger.certainty import REASON_CONTRADICTED, Certainty
from executive.ledger.item import ON_TABLE, REASON_NOT_FOUND, REASON_UNCERTAIN, ItemRecord, ItemRecords, State

MIN_EMPTY_PROBES = 3
"""Minimum number of descents that touched only the table (`ItemRecord.empty_probe_count`) at a phantom."""
FINAL_STATES = (State.PLACED, State.REJECTED, State.SKIPPED, State.LOST)
"""Final states of items that exist; other items end as PHANTOM."""


def set_final_states(
    records: ItemRecords,
    certainty: Certainty,
    explain_skipped_item: Callable[[ItemRecord], str],
    undeclared_labels: Collection[str],
    *,
    is_completed: bool,
    finish_reason: str = "",
) -> None:
    """Set and emit the final state of each item.

    Args:
        records: The items.
        certainty: Decides whether the evidence about an item suffices.
        explain_skipped_item: Function that returns the reason why the mission does not sort an item, or "".
        undeclared_labels: Classes that the cell does not declare.
        is_completed: True if the behaviour tree succeeded.
        finish_reason: Reason why the mission finished with open items, or "".
    """
    dropped = records.filter_by_state(State.DROPPED)
    dropped_items = [record for record in dropped if not record.was_taken_away]
    for record in records.all:
        skip_reason = explain_skipped_item(record)
        is_declared = record.label not in undeclared_labels
        final_state = find_final_state(
            record, certainty, skip_reason, is_declared=is_declared, is_completed=is_completed,
            finish_reason=finish_reason,
        )  # fmt: skip
        if bin := find_probable_bin(record):
            record.bin = bin
            final_state = (State.PLACED, REASON_PROBABLY_FELL)
        if final_state is not None:
            record.set_state(*final_state)
            records.emit(record)
    records.emit(*discard_moved_items(records.all, dropped_items))


def find_final_state(
    record: ItemRecord, certainty: Certainty, skip_reason: str, *, is_declared: bool, is_completed: bool,
    finish_reason: str = "",
) -> tuple[State, str] | None:  # fmt: skip
    """Return the final state of an item and the reason, or None if the current state is final.

    The first rule that applies determines the state:

    1. An item in the tool is rejected.
    2. An item is rejected if all its detections are doubtful and all later images of its place show it.
    3. An item whose probability of existence is below 0.5 is a phantom, unless it probably was there and
       left (`Belief.removal_probability`).
    4. An item that the tool never touched in at least `MIN_EMPTY_PROBES` descents to the table is a
       phantom, if a measurement of the tool has confirmed the class of another item.
    5. A dropped item that the tool may have moved while the journal was incomplete is rejected.
    6. An item is lost if it was dropped, or if it left its position on the table; an item of an undeclared
       class is then a phantom.
    7. An item that is already rejected stays rejected.
    8. An item whose class has no route, or no bin below its quota, is skipped; it is rejected if images
       contradict a bin of its class, or if its class is undeclared.
    9. If the mission finished with a reason, the item is skipped with this reason.
    10. If the mission was completed, an item with sufficient evidence (`is_certain`), no failed attempt
       and no evidence against its class is skipped, because a quota was reached or the operator quit.
    11. Any other item is rejected.

    Args:
        record: The item.
        certainty: Decides whether the evidence about an item suffices.
        skip_reason: Reason why the mission does not sort objects of the item's class, or "".
        is_declared: True if the cell declares the item's class.
        is_completed: True if the behaviour tree succeeded.
        finish_reason: Reason why the mission finished with open items, or "".
    """
    belief = record.belief
    if record.state is State.HELD:
        return State.REJECTED, "still in the tool when the run ended"
    if record.state not in (*ON_TABLE, State.DROPPED):
        return None
    if record.state is State.SEEN and not belief.look_count and belief.miss_probability == 1.0:
        return State.REJECTED, REASON_UNCERTAIN
    if not belief.is_probable and belief.removal_probability < 0.5:
        return State.PHANTOM, REASON_NOT_FOUND
    is_untouched = any(certainty.confirmed_labels) and not record.had_contact
    if record.empty_probe_count >= MIN_EMPTY_PROBES and is_untouched:
        count = record.empty_probe_count
        return State.PHANTOM, f"the tool found only the table at its position, {count} times"
    if record.state is State.DROPPED or certainty.is_position_empty(record) or not belief.is_probable:
        if not is_declared:
            return State.PHANTOM, "it is not on the table any more"
        return State.LOST, "known to exist, not found again"
    if record.state is State.REJECTED:
        return None
    if skip_reason:
        is_skipped = is_declared and not skip_reason.startswith(REASON_CONTRADICTED)
        return State.SKIPPED if is_skipped else State.REJECTED, skip_reason
    if finish_reason:
        return State.SKIPPED, finish_reason
    had_problem = record.failed_pick_count or record.last_contradiction
    if is_completed and certainty.is_certain(record) and not had_problem:
        return State.SKIPPED, "the mission was completed without it"
    return State.REJECTED, "the run ended before its turn"


def discard_moved_items(records: Collection[ItemRecord], dropped: Collection[ItemRecord]) -> list[ItemRecord]:
    """Set lost items that a person has moved elsewhere to PHANTOM, and return the phantoms.

    An item that may have left its place counts as lost. A lost item counts as moved if a new item of the same
    class appeared at an empty position after the last detection of the lost item; one earlier look at the
    position suffices if the lost item is known to have left its place. The new item must be proved to exist,
    and replaces only one lost item. Lost items in `dropped` do not count, because the tool held them after
    their last detection.
    """
    new_items = [record for record in records if record.belief.is_confirmed and record.state in FINAL_STATES]
    phantoms = []
    lost_items = (record for record in records if record.state is State.LOST or record.may_have_left)
    for lost_item in (record for record in lost_items if record not in dropped):
        candidates = (
            item
            for item in new_items
            if item.detected_label == lost_item.detected_label
            and item.first_stamp > lost_item.stamp
            and (item.was_place_empty or (lost_item.was_taken_away and item.was_place_searched))
        )
        if new_item := next(candidates, None):
            lost_item.set_state(State.PHANTOM, f"it is {new_item.item}")
            new_items.remove(new_item)
            phantoms.append(lost_item)
    return phantoms


def is_balanced(counts: Mapping[str, int]) -> bool:
    """Return True if `seen` is the sum of `placed`, `rejected`, `skipped` and `lost`."""
    return counts["seen"] == sum(counts[state.value] for state in FINAL_STATES)
