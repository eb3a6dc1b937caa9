"""Objects of a simulated world at the end of a run, for the audit."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

from executive.cell.bins import BIN_THICKNESS, Bin
from executive.cells.audit import FinalObject
from executive.cells.sim.world import World
from executive.geometry import Array

MIN_CENTRE_HEIGHT = -0.05
"""Minimum height of the centre of an object that is still on the table [m]."""


def list_final_objects(
    world: World,
    rest_positions: Mapping[int, Sequence[Array]],
    bins: Mapping[str, Bin],
    held_body: int | None = None,
    dropped_bodies: Collection[int] = (),
) -> Iterator[FinalObject]:
    """Yield the objects of a simulated world, including removed objects, at the end of a run.

    Args:
        world: The simulated world at the end of the run.
        rest_positions: Positions `(3,)` [m] of each body: initial position, and position after each move by
            a test and after each release by the tool.
        bins: The bins of the cell.
        held_body: Body that the tool holds, or None.
        dropped_bodies: Bodies that fell from the tool and have not been picked up since.
    """
    for body, positions in rest_positions.items():
        is_removed = body not in world.labels
        if is_removed:
            label, position = world.removed_objects[body]
        else:
            label, position = world.labels[body], world.get_object_pose(body).position
        # The centre of an object that leans on a bin wall may be above the wall.
        names = (name for name, bin in bins.items() if bin.contains(position, BIN_THICKNESS))
        bin_name = None if position[2] < MIN_CENTRE_HEIGHT else next(names, "")
        yield FinalObject(label, bin_name, positions, body in dropped_bodies, body == held_body, is_removed)
