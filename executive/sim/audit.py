"""What really became of the objects: ground truth, read only after a run is over."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from executive.cell import Routes
from executive.geometry import Array
from executive.ledger.item import Record, State
from executive.messages import Bin
from executive.sim.world import World

FLOOR = -0.05
"""A centre below this height has left the table [m]."""


def audit(
    world: World,
    initial: Mapping[int, Array],
    records: Sequence[Record],
    bins: Mapping[str, Bin],
    routes: Routes,
    reach: float,
    held: int | None = None,
) -> dict[str, int]:
    """Return how many bodies ended `right`, `wrong_bin`, `left` on the table, or `elsewhere`.

    What is still in the tool was let go nowhere and is `left`, also over a bin. `unseen` counts the
    bodies that no item of the ledger was first seen near.

    Args:
        world: The simulated world as the run left it.
        initial: Where each body `(3,)` [m] lay when the run began, by body id.
        records: The ledger's items.
        bins: The cell's bins.
        routes: Class label to the bins that are right for it.
        reach: How far from a body's first place an item may have been seen first [m].
        held: Body in the tool, or None.
    """
    counts = {"right": 0, "wrong_bin": 0, "left": 0, "elsewhere": 0, "unseen": 0}
    real = [record for record in records if record.state is not State.PHANTOM]
    for body, label in world.bodies.items():
        position = world.object_pose(body).position
        inside = next((name for name, bin in bins.items() if bin.contains(position)), None)
        if position[2] < FLOOR:
            counts["elsewhere"] += 1
        elif inside is not None and body != held:
            counts["right" if inside in routes.get(label, ()) else "wrong_bin"] += 1
        else:
            counts["left"] += 1
        near = [r for r in real if float(np.linalg.norm(r.first[:2] - initial[body][:2])) <= reach]
        if not near:
            counts["unseen"] += 1
    return counts
