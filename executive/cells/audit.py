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
        label: Class of the object, or `UNKNOWN`.
        bin: Name of the bin that contains the object; "" outside of all bins, None off the table.
        stood: Positions of the object `(3,)` [m] at the start, and after each move and each fall.
        has_fallen: True if the object fell from the tool and was not in the tool again.
        is_held: True if the object is in the tool.
        is_removed: True if the object was removed from the world; `bin` is then its place before that.
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

    An object in the tool is `left`, also above a bin. An object that fell into a wrong bin is out of reach
    and counts as `elsewhere` and as `fell_in_wrong_bin`. A removed object counts only if it was seen: as
    `right` or `wrong_bin` if it was placed in a bin, otherwise as `elsewhere`. `unseen` counts the objects
    in the world without an item first seen nearby; an unknown one of them counts only in a wrong bin.

    Args:
        objects: The objects of the world, including removed objects.
        records: The items of the ledger.
        routes: Names of the right bins of each class.
        reach: Largest distance between the first position of an item and a position of its object [m].
    """
    counts = dict.fromkeys(PLACES, 0)
    first_positions = [record.first_position for record in records if record.state is not State.PHANTOM]
    for final_object in objects:
        is_seen = any(
            float(np.linalg.norm((first - position)[:2])) <= reach
            for first in first_positions
            for position in final_object.stood
        )
        place = _classify(final_object, routes)
        if final_object.is_removed:
            was_emptied = place in ("right", "wrong_bin") and not final_object.has_fallen
            counts[place if was_emptied else "elsewhere"] += is_seen
            continue
        fell_in_wrong_bin = place == "wrong_bin" and final_object.has_fallen
        is_ignored = final_object.label == UNKNOWN and not is_seen
        if not is_ignored or place == "wrong_bin":
            counts["elsewhere" if fell_in_wrong_bin else place] += 1
        counts["fell_in_wrong_bin"] += fell_in_wrong_bin
        counts["unseen"] += not is_seen and not is_ignored
    return counts


def _classify(final_object: FinalObject, routes: Routes) -> str:
    if final_object.is_held:
        return "left"
    if not final_object.bin:
        return "elsewhere" if final_object.bin is None else "left"
    return "right" if final_object.bin in routes.get(final_object.label, ()) else "wrong_bin"
