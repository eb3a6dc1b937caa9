"""Counts of the objects by their true final positions in a simulated or fake cell, made only after a run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from executive.cell.protocols import Routes
from executive.cell.workcell import AUDIT_KEYS
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
        rest_positions: Positions of the object `(3,)` [m] at the start, and after each move and each fall.
        is_dropped: True if the object fell from the tool and has not been picked up since.
        is_held: True if the tool holds the object.
        is_removed: True if the object was removed from the world; `bin` is then its bin before the removal.
    """

    label: str
    bin: str | None
    rest_positions: Sequence[Array]
    is_dropped: bool
    is_held: bool = False
    is_removed: bool = False


def audit_objects(
    objects: Iterable[FinalObject], records: Sequence[Record], routes: Routes, max_distance: float
) -> dict[str, int]:
    """Return the number of objects that ended `right`, `wrong_bin`, `left` on the table, or `elsewhere`.

    A held object counts as `left`, even above a bin. An object that was dropped into a wrong bin counts as
    `elsewhere` and as `fell_in_wrong_bin`. An object is unseen if no item of the ledger was first seen near
    it. A removed object counts only if it was seen: as `right` or `wrong_bin` if it was placed in a bin,
    otherwise as `elsewhere`. An unseen object of unknown class is counted only if it is in a wrong bin, and
    never as `unseen`.

    Args:
        objects: The objects of the world, including removed objects.
        records: The items of the ledger.
        routes: Names of the permitted bins of each class.
        max_distance: Maximum horizontal distance from the first position of an item to its object [m].
    """
    counts = dict.fromkeys(AUDIT_KEYS, 0)
    first_positions = [record.first_position for record in records if record.state is not State.PHANTOM]
    for final_object in objects:
        is_seen = any(
            float(np.linalg.norm((first - position)[:2])) <= max_distance
            for first in first_positions
            for position in final_object.rest_positions
        )
        outcome = _find_outcome(final_object, routes)
        if final_object.is_removed:
            was_placed = outcome in ("right", "wrong_bin") and not final_object.is_dropped
            counts[outcome if was_placed else "elsewhere"] += is_seen
            continue
        fell_in_wrong_bin = outcome == "wrong_bin" and final_object.is_dropped
        is_ignored = final_object.label == UNKNOWN and not is_seen
        if not is_ignored or outcome == "wrong_bin":
            counts["elsewhere" if fell_in_wrong_bin else outcome] += 1
        counts["fell_in_wrong_bin"] += fell_in_wrong_bin
        counts["unseen"] += not is_seen and not is_ignored
    return counts


def _find_outcome(final_object: FinalObject, routes: Routes) -> str:
    """Return `right`, `wrong_bin`, `left` or `elsewhere`, regardless of drops and removals."""
    if final_object.is_held:
        return "left"
    if not final_object.bin:
        return "elsewhere" if final_object.bin is None else "left"
    return "right" if final_object.bin in routes.get(final_object.label, ()) else "wrong_bin"
