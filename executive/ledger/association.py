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
"""Factor on the distance for association up to which an observation may nevertheless show an item."""
MAX_PUSH_DISTANCE = 0.12
"""Maximum distance by which a person may push an item that still counts as the same item [m]."""
MAX_MISS_PROBABILITY_OF_MOVED = 0.05
"""Maximum probability that all looks missed an item by chance, for an item that may have been moved."""
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
        gate: Distance from an item up to which an observation always counts as near [m].
    """
    pairs = [
        (not staleness.is_settled(record), record.label != seen.detection.label, distance, seen, record)
        for seen in observations
        for record in records
        if (distance := record.distance_to(seen.position)) <= find_max_distance(record, seen.std, gate)
    ]
    matches: dict[Observation, Record] = {}
    for *_, observation, record in sorted(pairs, key=lambda pair: pair[:3]):
        if observation not in matches and record not in matches.values():
            matches[observation] = record
    return matches


def find_max_distance(record: Record, std: float, gate: float) -> float:
    """Return the maximum distance of an observation that is associated with an item [m].

    The maximum grows with the standard errors of both positions, from `gate` to `2 * gate`.

    Args:
        record: The item.
        std: Standard deviation of the observed position along each axis [m].
        gate: Smallest value of the maximum [m].
    """
    return min(max(gate, MAX_STANDARD_DEVIATIONS * math.hypot(record.standard_error, std)), 2 * gate)


def may_show(observation: Observation, record: Record, gate: float) -> bool:
    """Return True if an observation may show an item, even if the measured position has a large error."""
    max_distance = AMBIGUITY_FACTOR * find_max_distance(record, observation.std, gate)
    return record.distance_to(observation.position) <= max_distance


def find_moved_item(
    new: Record, records: Iterable[Record], staleness: Staleness, config: LedgerConfig
) -> Record | None:
    """Return the nearest item that is the new item after a drop or a move, or None.

    The class of the new item must be certain, because the new item may be another object that fell nearby.
    """
    if (
        new.state is not State.SEEN
        or new.attempt_count
        or new.belief.existence_probability < MIN_EXISTENCE_PROBABILITY
        or new.belief.class_error > config.max_class_error
    ):
        return None
    candidates = [old for old in records if _may_be_same_object(old, new, staleness, config)]
    return min(candidates, key=lambda old: _find_horizontal_distance(old, new), default=None)


def find_duplicate(record: Record, records: Iterable[Record], gate: float) -> Record | None:
    """Return the first other item in the state SEEN that is nearer to an item than `gate` [m], or None."""
    unsorted = [other for other in records if record.state is other.state is State.SEEN]
    others = (other for other in unsorted if other is not record)
    return next((other for other in others if other.distance_to(record.position) < gate), None)


def _may_be_same_object(old: Record, new: Record, staleness: Staleness, config: LedgerConfig) -> bool:
    """Return True if a new item may be the object of an old item that has left its position.

    The robot may push an object anywhere, a person by at most `MAX_PUSH_DISTANCE`. The robot may also have
    pushed the object of a phantom during an attempt to pick it.
    """
    if old is new or old.label != new.label:
        return False
    if old.state is State.DROPPED:
        return new.first_change_count > old.change_count
    change = staleness.find_change(old.position, old.change_count)
    may_be_moved_by_robot = change is not None and new.first_change_count >= change
    may_be_moved_by_person = (
        _find_horizontal_distance(old, new) <= MAX_PUSH_DISTANCE
        and new.first_stamp > old.stamp
        and old.belief.miss_probability <= config.max_miss_probability
    )
    is_phantom = old.state is State.PHANTOM and old.reason == REASON_NOT_FOUND and old.attempt_count > 0
    is_missing = (
        (old.state in ON_TABLE or is_phantom)
        and old.belief.miss_probability <= MAX_MISS_PROBABILITY_OF_MOVED
        and old.belief.probability_at_last_detection >= 0.5
    )
    return is_missing and (may_be_moved_by_robot or may_be_moved_by_person)


def _find_horizontal_distance(old: Record, new: Record) -> float:
    return float(np.linalg.norm((old.position - new.position)[:2]))
