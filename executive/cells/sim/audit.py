"""What really became of the objects: ground truth, read only after a run is over."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from executive.cell.bins import BIN_THICKNESS, Bin
from executive.cell.protocols import Routes
from executive.cell.workcell import PLACES
from executive.cells.sim.arrangements import UNKNOWN
from executive.cells.sim.world import World
from executive.geometry import Array
from executive.ledger.item import Record, State

FLOOR = -0.05
"""A centre below this height has left the table [m]."""


def audit(
    world: World,
    stood: Mapping[int, Sequence[Array]],
    records: Sequence[Record],
    bins: Mapping[str, Bin],
    routes: Routes,
    reach: float,
    held: int | None = None,
    fallen: Collection[int] = (),
) -> dict[str, int]:
    """Return how many bodies ended `right`, `wrong_bin`, `left` on the table, or `elsewhere`.

    A body in the tool is `left`, also over a bin. A body that fell into a wrong bin is out of reach: it
    counts as `elsewhere` and as `fell_in_wrong_bin`. A removed body counts only if it was seen before: in the
    bin that it was placed in, otherwise as `elsewhere`. `unseen` counts the bodies in the world that no item
    was first seen near. An unknown object that no item was seen near counts only in a bin, as `wrong_bin`.

    Args:
        world: The simulated world as the run left it.
        stood: By body, the positions `(3,)` [m] at the start and after each time that somebody moved it.
        records: The ledger's items.
        bins: The cell's bins.
        routes: Class label to the bins that are right for it.
        reach: Largest distance between the first position of an item and a position in `stood` [m].
        held: Body in the tool, or None.
        fallen: Bodies that fell from the tool and were not in it again.
    """
    counts = dict.fromkeys(PLACES, 0)
    real = [record for record in records if record.state is not State.PHANTOM]
    for body, places in stood.items():
        seen = any(
            float(np.linalg.norm(record.first[:2] - place[:2])) <= reach
            for record in real
            for place in places
        )
        if body not in world.bodies:
            end = _find_place(*world.removed[body], bins, routes)
            was_emptied = end in ("right", "wrong_bin") and body not in fallen
            counts[end if was_emptied else "elsewhere"] += seen
            continue
        label, position = world.bodies[body], world.object_pose(body).position
        end = "left" if body == held else _find_place(label, position, bins, routes)
        fell = end == "wrong_bin" and body in fallen
        unclaimed = label == UNKNOWN and not seen
        if not unclaimed or end == "wrong_bin":
            counts["elsewhere" if fell else end] += 1
        counts["fell_in_wrong_bin"] += fell
        counts["unseen"] += not seen and not unclaimed
    return counts


def _find_place(label: str, position: Array, bins: Mapping[str, Bin], routes: Routes) -> str:
    # The centre of an object that leans on a bin wall may be above the wall.
    inside = next((name for name, bin in bins.items() if bin.contains(position, BIN_THICKNESS)), None)
    if position[2] < FLOOR:
        return "elsewhere"
    if inside is None:
        return "left"
    return "right" if inside in routes.get(label, ()) else "wrong_bin"
