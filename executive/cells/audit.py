"""Final places of the objects of a simulated or fake cell: ground truth, read only after a run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from executive.cell.protocols import Routes
from executive.cell.workcell import PLACES
from executive.geometry import Array
from executive.ledger.item import Record, State

UNKNOWN = "unknown"
"""Label of an object without a class."""


@dataclass(frozen=True, eq=False)
class FinalObject:
    """An object at the end of a run.

    Attributes:
        label: Its class, or `UNKNOWN`.
        bin: Name of the bin in which it lies, "" outside of all bins, None if it has left the table.
        stood: Its positions `(3,)` [m] at the start and after each time that it was moved or fell.
        has_fallen: True if it fell from the tool and was not in the tool again.
        is_held: True if it is in the tool.
        is_removed: True if it was removed from the world; `bin` is then the place from which it was removed.
    """

    label: str
    bin: str | None
    stood: Sequence[Array]
    has_fallen: bool
    is_held: bool = False
    is_removed: bool = False


def audit_objects(
    objects: Iterable[FinalObject], records: Sequence[Record], routes: Routes, reach: float
) -> dict[str, int]:
    """Return the number of objects that ended `right`, `wrong_bin`, `left` on the table, or `elsewhere`.

    An object in the tool is `left`, also above a bin. An object that fell into a wrong bin is out of reach:
    it counts as `elsewhere` and as `fell_in_wrong_bin`. A removed object counts only if it was seen before:
    in the bin that it was placed in, otherwise as `elsewhere`. `unseen` counts the objects in the world for
    which no item was first seen nearby. An unseen unknown object counts only in a bin, as `wrong_bin`.

    Args:
        objects: The objects of the world, and those that were removed from it.
        records: The items of the ledger.
        routes: Names of the right bins of each class.
        reach: Largest distance between the first position of an item and a position of its object [m].
    """
    counts = dict.fromkeys(PLACES, 0)
    first_positions = [record.first_position for record in records if record.state is not State.PHANTOM]
    for one in objects:
        seen = any(
            float(np.linalg.norm((first - position)[:2])) <= reach
            for first in first_positions
            for position in one.stood
        )
        place = _classify(one, routes)
        if one.is_removed:
            was_emptied = place in ("right", "wrong_bin") and not one.has_fallen
            counts[place if was_emptied else "elsewhere"] += seen
            continue
        fell = place == "wrong_bin" and one.has_fallen
        unclaimed = one.label == UNKNOWN and not seen
        if not unclaimed or place == "wrong_bin":
            counts["elsewhere" if fell else place] += 1
        counts["fell_in_wrong_bin"] += fell
        counts["unseen"] += not seen and not unclaimed
    return counts


def _classify(one: FinalObject, routes: Routes) -> str:
    if one.is_held:
        return "left"
    if not one.bin:
        return "elsewhere" if one.bin is None else "left"
    return "right" if one.bin in routes.get(one.label, ()) else "wrong_bin"
