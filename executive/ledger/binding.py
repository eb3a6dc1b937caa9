"""Which detection is which item: one to one, nearest first."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from executive.geometry import Array
from executive.ledger.item import Record

SURE = 3.5
"""Standard deviations within which two measurements of one place lie, all but one in a thousand times."""


def reach(record: Record, spread: float, gate: float) -> float:
    """Return how far from an item [m] a detection of it may be localized.

    At least `gate`, more where the measurements scatter more, and at most twice that.

    Args:
        record: The item.
        spread: Standard deviation of the new measurement along each axis [m].
        gate: Distance that is always allowed [m].
    """
    return min(max(gate, SURE * math.hypot(record.spread, spread)), 2 * gate)


def bind(
    records: Sequence[Record],
    labels: Sequence[str],
    positions: Sequence[Array],
    spreads: Sequence[float],
    *,
    gate: float,
    settled: Callable[[Record], bool],
) -> dict[int, Record]:
    """Return the item of each detection that lies where a known one was seen, by the detection's index.

    Each round is over what the ones before have left. Items that nothing has disturbed come first, of the
    same class and then of any (the class is evidence, not identity). Then, of the same class and of any,
    those that may have been pushed and still are about where they were.
    """
    bound: dict[int, Record] = {}

    def assign(candidates: Sequence[Record], same_class: bool) -> None:
        taken = {id(record) for record in bound.values()}
        pairs = sorted(
            (float(np.linalg.norm(record.position - positions[index])), index, order)
            for order, record in enumerate(candidates)
            for index in range(len(positions))
            if index not in bound
            and id(record) not in taken
            and (not same_class or record.label == labels[index])
        )
        for distance, index, order in pairs:
            record = candidates[order]
            allowed = reach(record, spreads[index], gate)
            if distance <= allowed and index not in bound and id(record) not in taken:
                bound[index] = record
                taken.add(id(record))

    quiet = [record for record in records if settled(record)]
    pushed = [record for record in records if not settled(record)]
    for candidates in (quiet, pushed):
        for same_class in (True, False):
            assign(candidates, same_class)
    return bound
