"""Association of observations with items: by position first, then by class.

`associate` matches observations to nearby items. `find_moved_item` matches a new item to a known item that
may have been moved. `find_duplicate` finds a second item at the position of an item.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from executive.cell.frame import Observation
from executive.ledger.certainty import MIN_EXISTENCE_PROBABILITY, Certainty
from executive.ledger.coverage import Staleness
from executive.ledger.item import ON_TABLE, REASON_NOT_FOUND, ItemRecord, State

MAX_STANDARD_DEVIATIONS = 3.5
"""Number of standard deviations within which two measurements of a position agree with probability 0.999."""
AMBIGUITY_FACTOR = 1.5
"""Maximum distance between an item and an observation that may show it, in units of the gating distance."""
MAX_PUSH_DISTANCE = 0.12
"""Maximum distance by which a person may push an item that still counts as the same item [m]."""
MAX_MISS_PROBABILITY_OF_MOVED_ITEM = 0.05
"""Maximum probability, for a moved item, that all images since its last detection missed it by chance."""


def associate(
    observations: Iterable[Observation], records: Sequence[ItemRecord], staleness: Staleness, gate: float
) -> dict[Observation, ItemRecord]:
    """Return the item of each observation that shows a known item.

    Pairs are matched in this order: first pairs with an item that cannot have moved since its last detection,
    then pairs of equal classes (the class is evidence, not identity), then pairs with a small distance.

    Args:
        observations: Confident observations on the table.
        records: Items on the table.
        staleness: Record of the actions of the robot that may have moved objects.
        gate: Lower bound of the gating distance (`compute_association_distance`) [m].
    """
    pairs = []
    for observation in observations:
        for record in records:
            distance = record.distance_to(observation.position)
            if distance <= compute_association_distance(record, observation, gate):
                is_other_class = record.detected_label != observation.detection.label
                rank = (not staleness.is_unmoved(record), is_other_class, distance)
                pairs.append((rank, observation, record))
    matches: dict[Observation, ItemRecord] = {}
    for _, observation, record in sorted(pairs, key=lambda pair: pair[0]):
        if observation not in matches and record not in matches.values():
            matches[observation] = record
    return matches


def compute_association_distance(record: ItemRecord, observation: Observation, gate: float) -> float:
    """Return the gating distance [m]: the maximum distance between an item and an observation assigned to it.

    The gating distance grows with the standard errors of both positions, from `gate` [m] to `2 * gate`.
    """
    error = math.hypot(record.standard_error, observation.std)
    return min(max(gate, MAX_STANDARD_DEVIATIONS * error), 2 * gate)


def may_show_item(observation: Observation, record: ItemRecord, gate: float) -> bool:
    """Return True if an observation lies within `AMBIGUITY_FACTOR` gating distances of an item.

    The observation may then show the item. `gate` is the lower bound of the gating distance [m].
    """
    max_distance = AMBIGUITY_FACTOR * compute_association_distance(record, observation, gate)
    return record.distance_to(observation.position) <= max_distance


def find_moved_item(
    new_item: ItemRecord, records: Iterable[ItemRecord], staleness: Staleness, certainty: Certainty
) -> ItemRecord | None:
    """Return the item that may have been dropped or moved to the position of a new item, or None.

    An item that the tool dropped must be somewhere, and comes first; then the nearest item. For other items,
    the class of the new item must be certain, because another object may have been moved to the position.
    """
    if (
        new_item.state is not State.SEEN
        or new_item.failed_pick_count
        or new_item.belief.existence_probability < MIN_EXISTENCE_PROBABILITY
    ):
        return None
    candidates = [item for item in records if _may_be_same_object(item, new_item, staleness, certainty)]

    def make_sort_key(item: ItemRecord) -> tuple[bool, float]:
        return item.state is not State.DROPPED, _compute_horizontal_distance(item, new_item)

    return min(candidates, key=make_sort_key, default=None)


def find_duplicate(record: ItemRecord, records: Iterable[ItemRecord], gate: float) -> ItemRecord | None:
    """Return another item within `gate` [m] of an item if both are in the state SEEN, or None."""
    others = (other for other in records if record.state is other.state is State.SEEN and other is not record)
    return next((other for other in others if other.distance_to(record.position) < gate), None)


def _may_be_same_object(
    old_item: ItemRecord, new_item: ItemRecord, staleness: Staleness, certainty: Certainty
) -> bool:
    """Return True if a new item may be the same object as an old item that recent images no longer show.

    The robot may push an object anywhere, a person by at most `MAX_PUSH_DISTANCE`. An item that became a
    phantom after an attempt to pick it may be an object that the attempt pushed away. An item that left its
    place may be anywhere; the new item then is at a position that a look found empty.
    """
    if old_item is new_item or old_item.detected_label != new_item.detected_label:
        return False
    if old_item.state is State.DROPPED and not old_item.was_taken_away:
        return new_item.first_change_count > old_item.change_count
    if not certainty.is_class_certain(new_item):
        return False
    if old_item.state is State.DROPPED:
        return new_item.was_place_searched and new_item.first_stamp > old_item.stamp
    change_number = staleness.find_change_number(old_item.position, old_item.change_count)
    may_be_moved_by_robot = change_number is not None and new_item.first_change_count >= change_number
    may_be_moved_by_person = (
        _compute_horizontal_distance(old_item, new_item) <= MAX_PUSH_DISTANCE
        and new_item.first_stamp > old_item.stamp
        and certainty.is_position_empty(old_item)
    )
    is_pushed_phantom = (
        old_item.state is State.PHANTOM
        and old_item.reason == REASON_NOT_FOUND
        and old_item.failed_pick_count > 0
    )
    is_missing = (
        (old_item.state in ON_TABLE or is_pushed_phantom)
        and old_item.belief.miss_probability <= MAX_MISS_PROBABILITY_OF_MOVED_ITEM
        and old_item.belief.probability_at_last_detection >= 0.5
    )
    return is_missing and (may_be_moved_by_robot or may_be_moved_by_person)


def _compute_horizontal_distance(record: ItemRecord, other_record: ItemRecord) -> float:
    """Return the horizontal distance between two items [m]."""
    return float(np.linalg.norm((record.position - other_record.position)[:2]))
