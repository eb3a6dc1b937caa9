"""Association of observations with items: by position first, then by class.

A look is matched to the items in three steps: each observation to an item near it (`associate`), a new item
to an item that may have been moved there (`find_moved`), and an item to another item at the same position
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
"""Number of standard deviations within which two measurements of a position agree with probability 0.999."""
AMBIGUITY_FACTOR = 1.5
"""Factor on the allowed distance up to which an observation may still show an item."""
MAX_PUSH_DISTANCE = 0.12
"""Largest distance by which a person may push an item so that it still counts as the same item [m]."""
MAX_MISS_PROBABILITY_OF_MOVED = 0.05
"""An item may have been moved elsewhere if the probability that looks missed it is at most this."""
MIN_EXISTENCE_PROBABILITY = 0.9
"""Probability of existence from which an item is picked, and may be a moved item."""


def associate(
    observations: Iterable[Observation], records: Sequence[Record], staleness: Staleness, gate: float
) -> dict[Observation, Record]:
    """Return the item of each observation that shows a known item.

    Settled items come first, then items that may have been moved, but not far. Within both groups, an item of
    the observed class precedes other items (the class is evidence, not identity), and a near item precedes a
    far item.

    Args:
        observations: Confident observations on the table.
        records: Items on the table.
        staleness: Changes of the table.
        gate: Distance that is always allowed [m].
    """
    pairs = [
        (not staleness.is_settled(record), record.label != seen.detection.label, distance, seen, record)
        for seen in observations
        for record in records
        if (distance := record.distance_to(seen.position)) <= max_distance(record, seen.std, gate)
    ]
    matches: dict[Observation, Record] = {}
    for *_, observation, record in sorted(pairs, key=lambda pair: pair[:3]):
        if observation not in matches and record not in matches.values():
            matches[observation] = record
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


def may_show(observation: Observation, record: Record, gate: float) -> bool:
    """Return True if an observation may show an item, even with a large error of the measured position."""
    allowed = AMBIGUITY_FACTOR * max_distance(record, observation.std, gate)
    return record.distance_to(observation.position) <= allowed


def find_moved(
    new: Record, records: Iterable[Record], staleness: Staleness, config: LedgerConfig
) -> Record | None:
    """Return the nearest item that was dropped or moved, and is the new item; None if there is none.

    The class of the new item must be certain: until then, the new item may be another object that fell
    nearby.
    """
    if (
        new.state is not State.SEEN
        or new.attempts
        or new.belief.probability < MIN_EXISTENCE_PROBABILITY
        or new.belief.class_error > config.misjudged
    ):
        return None
    missing = [old for old in records if _may_have_become(old, new, staleness, config)]
    return min(missing, key=lambda old: _horizontal_distance(old, new), default=None)


def find_duplicate(record: Record, records: Iterable[Record], gate: float) -> Record | None:
    """Return the first other item on the table that is too near to an item to be another object, or None."""
    open_items = [other for other in records if record.state is other.state is State.SEEN]
    others = (other for other in open_items if other is not record)
    return next((other for other in others if other.distance_to(record.position) < gate), None)


def _may_have_become(old: Record, new: Record, staleness: Staleness, config: LedgerConfig) -> bool:
    """Return True if a new item may be an item that does not lie at its position any more.

    The robot may push an item anywhere, a person by at most `MAX_PUSH_DISTANCE`. A phantom may have been an
    object until the robot tried to pick the phantom.
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
    is_phantom = old.state is State.PHANTOM and old.reason == REASON_NOT_FOUND and old.attempts > 0
    is_missing = (
        (old.state in LYING or is_phantom)
        and old.belief.miss_probability <= MAX_MISS_PROBABILITY_OF_MOVED
        and old.belief.last_probability >= 0.5
    )
    return is_missing and (by_robot or by_person)


def _horizontal_distance(old: Record, new: Record) -> float:
    return float(np.linalg.norm((old.position - new.position)[:2]))
