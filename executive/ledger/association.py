"""Association of observations with items: by position first, then by class.

The association has three steps: `associate` matches each observation to a nearby item,
`find_moved_item` matches a new item to an item that may have been moved to its position, and `find_duplicate`
matches two items at one position.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from executive.cell.config import LedgerConfig
from executive.cell.detection import Observation
from executive.ledger.item import ON_TABLE, REASON_NOT_FOUND, Record, State
from executive.ledger.staleness import Staleness

MAX_STANDARD_DEVIATIONS = 3.5
"""Number of standard deviations within which two measurements of a position agree with probability 0.999."""
AMBIGUITY_FACTOR = 1.5
"""Maximum distance of an observation that may show an item, as a multiple of the association distance."""
MAX_PUSH_DISTANCE = 0.12
"""Maximum distance by which a person may push an item that still counts as the same item [m]."""
MAX_MISS_PROBABILITY_OF_MOVED_ITEM = 0.05
"""Maximum probability that looks missed an item at its old position by chance, if it counts as moved."""
MIN_EXISTENCE_PROBABILITY = 0.9
"""Minimum probability of existence of an item that is picked, or matched to a moved item."""


def associate(
    observations: Iterable[Observation], records: Sequence[Record], staleness: Staleness, gate: float
) -> dict[Observation, Record]:
    """Return the item of each observation that shows a known item.

    Items that cannot have moved since their last detection are matched first. Otherwise, an item of the
    observed class precedes other items (the class is evidence, not identity), and a near item precedes a far
    item.

    Args:
        observations: Confident observations on the table.
        records: Items on the table.
        staleness: Changes of the table by the robot.
        gate: Minimum association distance [m].
    """
    pairs = []
    for observation in observations:
        for record in records:
            distance = record.distance_to(observation.position)
            if distance <= compute_association_distance(record, observation, gate):
                is_other_class = record.label != observation.detection.label
                rank = (not staleness.is_settled(record), is_other_class, distance)
                pairs.append((rank, observation, record))
    matches: dict[Observation, Record] = {}
    for _, observation, record in sorted(pairs, key=lambda pair: pair[0]):
        if observation not in matches and record not in matches.values():
            matches[observation] = record
    return matches


def compute_association_distance(record: Record, observation: Observation, gate: float) -> float:
    """Return the maximum distance between an item and an observation that is associated with the item [m].

    The distance grows with the standard errors of both positions, from `gate` [m] to `2 * gate`.
    """
    error = math.hypot(record.standard_error, observation.std)
    return min(max(gate, MAX_STANDARD_DEVIATIONS * error), 2 * gate)


def may_show(observation: Observation, record: Record, gate: float) -> bool:
    """Return True if an observation may show an item, even if the measured position has a large error.

    `gate` is the minimum association distance [m].
    """
    max_distance = AMBIGUITY_FACTOR * compute_association_distance(record, observation, gate)
    return record.distance_to(observation.position) <= max_distance


def find_moved_item(
    new: Record, records: Iterable[Record], staleness: Staleness, config: LedgerConfig
) -> Record | None:
    """Return the nearest item whose object may have been dropped or moved to a new item's position, or None.

    The class of the new item must be certain, because another object may have fallen to the position.
    """
    if (
        new.state is not State.SEEN
        or new.attempt_count
        or new.belief.existence_probability < MIN_EXISTENCE_PROBABILITY
        or new.belief.class_error > config.max_class_error
    ):
        return None
    candidates = [old for old in records if _may_be_same_object(old, new, staleness, config)]
    return min(candidates, key=lambda old: _compute_horizontal_distance(old, new), default=None)


def find_duplicate(record: Record, records: Iterable[Record], gate: float) -> Record | None:
    """Return the first other item nearer than `gate` [m] to an item, both in the state SEEN, or None."""
    others = (other for other in records if record.state is other.state is State.SEEN and other is not record)
    return next((other for other in others if other.distance_to(record.position) < gate), None)


def _may_be_same_object(old: Record, new: Record, staleness: Staleness, config: LedgerConfig) -> bool:
    """Return True if a new item may be the object of an old item that is missing at its position.

    The robot may push an object anywhere, a person by at most `MAX_PUSH_DISTANCE`. An item that became a
    phantom after an attempt to pick it may be an object that the attempt pushed away.
    """
    if old is new or old.label != new.label:
        return False
    if old.state is State.DROPPED:
        return new.first_change_count > old.change_count
    change_number = staleness.find_change_number(old.position, old.change_count)
    may_be_moved_by_robot = change_number is not None and new.first_change_count >= change_number
    may_be_moved_by_person = (
        _compute_horizontal_distance(old, new) <= MAX_PUSH_DISTANCE
        and new.first_stamp > old.stamp
        and old.belief.miss_probability <= config.max_miss_probability
    )
    is_pushed_phantom = (
        old.state is State.PHANTOM and old.reason == REASON_NOT_FOUND and old.attempt_count > 0
    )
    is_missing = (
        (old.state in ON_TABLE or is_pushed_phantom)
        and old.belief.miss_probability <= MAX_MISS_PROBABILITY_OF_MOVED_ITEM
        and old.belief.probability_at_last_detection >= 0.5
    )
    return is_missing and (may_be_moved_by_robot or may_be_moved_by_person)


def _compute_horizontal_distance(first: Record, second: Record) -> float:
    """Return the horizontal distance between two items [m]."""
    return float(np.linalg.norm((first.position - second.position)[:2]))
