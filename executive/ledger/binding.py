"""Which detection is which item: one to one, nearest first, by ever weaker evidence."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from executive.geometry import Array
from executive.ledger.item import Record, State


def bind(
    records: Sequence[Record],
    labels: Sequence[str],
    positions: Sequence[Array],
    *,
    gate: float,
    settled: Callable[[Record], bool],
) -> dict[int, Record]:
    """Return the item of each detection that belongs to a known one, by the detection's index.

    Each round is over what the ones before have left. Items that nothing has disturbed come first, within
    `gate` [m], of the same class and then of any (the class is evidence, not identity). Then, of the same
    class, those that may have been pushed and are where they were; those that were dropped, anywhere;
    those that may have been pushed, anywhere. Last, one of any class where a pushed item was.
    """
    bound: dict[int, Record] = {}

    def assign(candidates: Sequence[Record], reach: float, same_class: bool) -> None:
        taken = {id(record) for record in bound.values()}
        pairs = sorted(
            (float(np.linalg.norm(record.position[:2] - positions[index][:2])), index, order)
            for order, record in enumerate(candidates)
            for index in range(len(positions))
            if index not in bound
            and id(record) not in taken
            and (not same_class or record.label == labels[index])
        )
        for distance, index, order in pairs:
            record = candidates[order]
            if distance <= reach and index not in bound and id(record) not in taken:
                bound[index] = record
                taken.add(id(record))

    quiet = [record for record in records if record.state is not State.DROPPED and settled(record)]
    pushed = [record for record in records if record.state is not State.DROPPED and not settled(record)]
    dropped = [record for record in records if record.state is State.DROPPED]
    assign(quiet, gate, same_class=True)
    assign(quiet, gate, same_class=False)
    assign(pushed, gate, same_class=True)
    assign(dropped, np.inf, same_class=True)
    assign(pushed, np.inf, same_class=True)
    assign(pushed, gate, same_class=False)
    return bound
