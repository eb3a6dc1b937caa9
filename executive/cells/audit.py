"""Counts of the objects of a simulated or fake cell by their true positions at the end of a run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from executive.cell.bins import Bin
from executive.cell.protocols import Routes
from executive.cell.workcell import AUDIT_KEYS
from executive.geometry import Array
from executive.ledger.item import ItemRecord, State

UNKNOWN_LABEL = "unknown"
"""Label of an object without a class."""


@dataclass(frozen=True, eq=False)
class FinalObject:
    """An object at the end of a run.

    Attributes:
        label: Class of the object, or `UNKNOWN_LABEL`.
        bin: Name of the bin that contains the object; "" outside of all bins, None below the table.
        rest_positions: Positions of the object `(3,)` [m] at the start, and after each move and each fall.
        is_dropped: True if the object fell from the tool and has not been picked up since.
        is_held: True if the tool holds the object.
        is_removed: True if the object was removed from the world; `bin` is then the bin before the removal.
    """

    label: str
    bin: str | None
    rest_positions: Sequence[Array]
    is_dropped: bool
    is_held: bool = False
    is_removed: bool = False


def audit_objects(
    objects: Iterable[FinalObject],
    records: Sequence[ItemRecord],
    bins: Mapping[str, Bin],
    routes: Routes,
    max_distance: float,
) -> dict[str, int]:
    """Return the number of objects by outcome.

    `right` and `wrong_bin` count objects in permitted and in other bins. `left` counts objects on the table
    and the held object. `elsewhere` counts objects below the table, and objects that fell into a wrong bin,
    which `fell_in_wrong_bin` counts too. `unseen` counts objects near which no ledger item was first seen.
    A removed object counts only if it was seen: as `elsewhere`, unless the tool placed the object in a bin.
    An unseen object without a class counts only if it is in a wrong bin, and never as `unseen`.

    Args:
        objects: The objects of the world, including removed objects.
        records: The items of the ledger.
        bins: The bins of the cell.
        routes: Names of the permitted bins of each class.
        max_distance: Maximum horizontal distance between the first position of an item and its object [m].
    """
    counts = dict.fromkeys(AUDIT_KEYS, 0)
    first_positions = [record.first_position for record in records if record.state is not State.PHANTOM]
    for final_object in objects:
        # For an item in a bin, a resumed run records the centre of the bin as first position.
        bin_centre = [bins[final_object.bin].position] if final_object.bin else []
        is_seen = any(
            np.linalg.norm((first_position - position)[:2]) <= max_distance
            for first_position in first_positions
            for position in (*final_object.rest_positions, *bin_centre)
        )
        outcome = _find_outcome(final_object, routes)
        if final_object.is_removed:
            was_placed = outcome in ("right", "wrong_bin") and not final_object.is_dropped
            counts[outcome if was_placed else "elsewhere"] += is_seen
            continue
        fell_in_wrong_bin = outcome == "wrong_bin" and final_object.is_dropped
        is_ignored = final_object.label == UNKNOWN_LABEL and not is_seen
        if not is_ignored or outcome == "wrong_bin":
            counts["elsewhere" if fell_in_wrong_bin else outcome] += 1
        counts["fell_in_wrong_bin"] += fell_in_wrong_bin
        counts["unseen"] += not is_seen and not is_ignored
    return counts


def _find_outcome(final_object: FinalObject, routes: Routes) -> str:
    """Return `right`, `wrong_bin`, `left` or `elsewhere` for the final position, without regard to drops."""
    if final_object.is_held:
        return "left"
    if not final_object.bin:
        return "elsewhere" if final_object.bin is None else "left"
    return "right" if final_object.bin in routes.get(final_object.label, ()) else "wrong_bin"
