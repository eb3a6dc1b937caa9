"""Order in which targets are picked, by the total travel of the tool without a load."""

from __future__ import annotations

import math
from collections.abc import Sequence

from executive.cell.objects import Target
from executive.cell.protocols import Cell
from executive.manipulation.tool_goals import choose_bin


def sort_by_tour(cell: Cell, targets: Sequence[Target]) -> list[Target]:
    """Return pickable targets, sorted by the length of the tour that begins with each target, shortest first.

    A tour leads from the destination of the arm to the first target, and from the bin of each target to the
    nearest of the remaining targets. The transports from the targets to their bins are not counted, because
    their total length is the same in all tours.
    """
    places = [cell.bins[choose_bin(cell, target.item)].position for target in targets]
    distances = [
        [math.dist(place[:2], target.position[:2]) for target in targets]
        for place in (cell.arm.destination, *places)
    ]
    lengths = {target.item: _measure_tour(distances, first) for first, target in enumerate(targets)}
    return sorted(targets, key=lambda target: (lengths[target.item], target.item))


def _measure_tour(distances: Sequence[Sequence[float]], first: int) -> float:
    """Return the length [m] of the tour that begins with a target.

    Args:
        distances: Horizontal distances of all targets [m]: row 0 from the start of the tour, row `i + 1` from
            the bin of target `i`.
        first: Index of the first target.
    """
    remaining, last, length = set(range(len(distances) - 1)) - {first}, first, distances[0][first]
    while remaining:
        row = distances[last + 1]
        last = min(remaining, key=lambda index: (row[index], index))
        length += row[last]
        remaining.remove(last)
    return length
