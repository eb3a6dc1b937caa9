"""Association of observations with items: by position first, then by class.

A look is matched to the items in three steps: each observation to an item near it (`associate`), a new item
to an item that may have been moved there (`find_moved`), and an item to another one at the same position
(`find_duplicate`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from executive.cell.config import LedgerConfig
from executive.cell.detection import Observation
from executive.ledger.item import LYING, REASON_NOT_FOUND, Record, State
from executive.ledger.staleness import Staleness

MAX_STANDARD_DEVIATIONS = 3.5
"""Number of standard deviations within which two measurements of one position lie, with probability 0.999."""
AMBIGUITY_FACTOR = 1.5
"""Factor on the allowed distance up to which an observation may still show an item."""
MAX_PUSH_DISTANCE = 0.12
"""Largest distance by which a person may push an item so that it still counts as the same item [m]."""
MAX_MISS_PROBABILITY_OF_MOVED = 0.05
"""An item may have been moved elsewhere if the probability that looks missed it is at most this."""
MIN_PROBABILITY = 0.9
"""Probability of existence from which an item is picked, and may be a moved item."""


def associate(
    observations: Iterable[Observation], records: Sequence[Record], staleness: Staleness, gate: float
) -> dict[Observation, Record]:
    """Return the item of each observation that shows a known item.

    Settled items come first, then items that may have been moved, but not far. Within both groups, an item of
    the observed class precedes other items (the class is evidence, not identity), and a near item a far one.

    Args:
        observations: Confident observations on the table.
        records: Items on the table.
        staleness: Changes of the table.
        gate: Distance that is always allowed [m].
    """
    pairs = [
        (not staleness.is_settled(record), record.label != one.detection.label, distance, one, record)
        for one in observations
        for record in records
        if (distance := record.distance_to(one.position)) <= max_distance(record, one.std, gate)
    ]
    matches: dict[Observation, Record] = {}
    for *_, one, record in sorted(pairs, key=lambda pair: pair[:3]):
        if one not in matches and record not in matches.values():
            matches[one] = record
    return matches


def max_distance(record: Record, std: float, gate: float) -> float:
    """Return the distance from an item [m] up to which an observation may show it.

    The distance grows with the standard errors, from `gate` to twice that.

    Args:
        record: The item.
        std: Standard deviation of the observation along each axis [m].
        gate: Distance that is always allowed [m].
    """
    return min(max(gate, MAX_STANDARD_DEVIATIONS * math.hypot(record.std, std)), 2 * gate)


def may_show(one: Observation, record: Record, gate: float) -> bool:
    """Return True if an observation may show an item, even with a large error of the measured position."""
    return record.distance_to(one.position) <= AMBIGUITY_FACTOR * max_distance(record, one.std, gate)


def find_moved(
    new: Record, records: Iterable[Record], staleness: Staleness, config: LedgerConfig
) -> Record | None:
    """Return the nearest item that was dropped or moved, and is the new item; None if there is none.

    The class of the new item must be certain: until then, the new item may be another object that fell
    nearby.
    """
    is_candidate = new.state is State.SEEN and not new.attempts and new.belief.probability >= MIN_PROBABILITY
    if not is_candidate or new.belief.class_error > config.misjudged:
        return None
    missing = [old for old in records if _may_have_become(old, new, staleness, config)]
    return min(missing, key=lambda old: _horizontal_distance(old, new), default=None)


def find_duplicate(record: Record, records: Iterable[Record], gate: float) -> Record | None:
    """Return the first other item on the table that is too near to be another object, or None."""
    for other in records:
        is_near = other is not record and other.distance_to(record.position) < gate
        if is_near and record.state is other.state is State.SEEN:
            return other
    return None


def _may_have_become(old: Record, new: Record, staleness: Staleness, config: LedgerConfig) -> bool:
    """Return True if a new item may be an item that does not lie at its position any more.

    The robot may have pushed it anywhere; a person, at most `MAX_PUSH_DISTANCE`. A phantom that the robot
    tried to pick may have been an object until then.
    """
    if old is new or old.label != new.label:
        return False
    if old.state is State.DROPPED:
        return new.first_epoch > old.epoch
    change = staleness.find_change(old.position, old.epoch)
    by_robot = change is not None and new.first_epoch >= change
    by_person = (
        _horizontal_distance(old, new) <= MAX_PUSH_DISTANCE
        and new.first_stamp > old.stamp
        and old.belief.miss_probability <= config.overlooked
    )
    is_phantom = old.state is State.PHANTOM and old.why == REASON_NOT_FOUND and old.attempts > 0
    is_missing = (
        (old.state in LYING or is_phantom)
        and old.belief.miss_probability <= MAX_MISS_PROBABILITY_OF_MOVED
        and old.belief.last_probability >= 0.5
    )
    return is_missing and (by_robot or by_person)


def _horizontal_distance(old: Record, new: Record) -> float:
    return float(np.linalg.norm((old.position - new.position)[:2]))
