"""Audit of a run: the true places of the objects at its end, compared with what the ledger has seen."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from executive.cell.devices import TrueObject
from executive.cell.objects import UNKNOWN_LABEL, Bin
from executive.cell.protocols import Routes
from executive.geometry import Array
from executive.ledger.item import ItemRecord, State

AUDIT_KEYS = ("right", "wrong_bin", "left", "elsewhere", "fell_in_wrong_bin", "unseen")
"""Keys of the object counts of an audit: objects in permitted bins (`right`), in other bins, on the table
(`left`), elsewhere; and, counted a second time, objects that fell into a wrong bin or were never detected."""


def count_outcomes(
    objects: Iterable[TrueObject],
    records: Sequence[ItemRecord],
    bins: Mapping[str, Bin],
    routes: Routes,
    max_distance: float,
    ignored_positions: Sequence[Array] = (),
) -> dict[str, int]:
    """Return the number of objects by outcome.

    * `right`: objects in a permitted bin
    * `wrong_bin`: objects in another bin, except objects that fell into it
    * `left`: objects on the table, and the held object
    * `elsewhere`: objects below the table, and objects that fell into a wrong bin
    * `fell_in_wrong_bin`: only the objects that fell into a wrong bin
    * `unseen`: objects that were never seen: the ledger contains no item, except phantoms, whose first
      position has a horizontal distance of at most `max_distance` [m] from a rest position of the object
      or from the centre of its bin

    A removed object counts only if it was seen: by its bin if the tool placed it there, else as `elsewhere`.
    An object with `UNKNOWN_LABEL` that was never seen counts only if it is in a wrong bin, not as `unseen`;
    so does any other unseen object that was detected with an ignored label, at one of `ignored_positions`.
    """
    counts = dict.fromkeys(AUDIT_KEYS, 0)
    first_positions = [record.first_position for record in records if record.state is not State.PHANTOM]
    for final_object in objects:
        # For an item in a bin, a resumed run records the centre of the bin as first position.
        bin_centre = [bins[final_object.bin].position] if final_object.bin else []
        positions = (*final_object.rest_positions, *bin_centre)
        is_seen = _is_any_near(first_positions, positions, max_distance)
        if not is_seen and _is_any_near(ignored_positions, positions, max_distance):
            final_object = replace(final_object, label=UNKNOWN_LABEL)
        for key in _find_outcomes(final_object, _find_place(final_object, routes), is_seen):
            counts[key] += 1
    return counts


def _is_any_near(points: Sequence[Array], positions: Sequence[Array], max_distance: float) -> bool:
    """Return True if a point `(3,)` [m] is at most `max_distance` [m] from a position, seen from above."""
    return any(math.dist(point[:2], place[:2]) <= max_distance for point in points for place in positions)


def _find_outcomes(final_object: TrueObject, place: str, is_seen: bool) -> Iterator[str]:
    """Yield the keys of the counts that include an object with a final `place`."""
    if final_object.is_removed:
        if is_seen:
            was_placed = place in ("right", "wrong_bin") and not final_object.is_dropped
            yield place if was_placed else "elsewhere"
    elif place == "wrong_bin" and final_object.is_dropped:
        yield from ("elsewhere", "fell_in_wrong_bin")
    elif place == "wrong_bin" or is_seen or final_object.label != UNKNOWN_LABEL:
        yield place
    if not (is_seen or final_object.is_removed or final_object.label == UNKNOWN_LABEL):
        yield "unseen"


def _find_place(final_object: TrueObject, routes: Routes) -> str:
    """Return `right`, `wrong_bin`, `left` or `elsewhere` for the final position, without regard to drops."""
    if final_object.is_held:
        return "left"
    if not final_object.bin:
        return "elsewhere" if final_object.bin is None else "left"
    return "right" if final_object.bin in routes.get(final_object.label, ()) else "wrong_bin"
