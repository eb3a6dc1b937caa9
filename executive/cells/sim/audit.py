"""Number of bodies of a simulated world by outcome, for tests and reports after a run."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

from executive.cell.bins import BIN_THICKNESS, Bin
from executive.cell.protocols import Routes
from executive.cells.audit import FinalObject, audit_objects
from executive.cells.sim.world import World
from executive.geometry import Array
from executive.ledger.item import ItemRecord

MIN_CENTRE_HEIGHT = -0.05
"""Minimum height of the centre of an object that is still on the table [m]."""


def audit_bodies(
    world: World,
    rest_positions: Mapping[int, Sequence[Array]],
    records: Sequence[ItemRecord],
    bins: Mapping[str, Bin],
    routes: Routes,
    max_distance: float,
    held_body: int | None = None,
    dropped_bodies: Collection[int] = (),
) -> dict[str, int]:
    """Return the number of bodies of a simulated world by outcome, as `audit_objects` defines them.

    Args:
        world: The simulated world at the end of the run.
        rest_positions: Positions `(3,)` [m] of each body: initial position, and position after each move by
            a test and after each release by the tool.
        records: The items of the ledger.
        bins: The bins of the cell.
        routes: Names of the permitted bins of each class.
        max_distance: Maximum horizontal distance between the first position of an item and its object [m].
        held_body: Body that the tool holds, or None.
        dropped_bodies: Bodies that fell from the tool and have not been picked up since.
    """

    def iterate_final_objects() -> Iterator[FinalObject]:
        for body, positions in rest_positions.items():
            is_removed = body not in world.labels
            if is_removed:
                label, position = world.removed_objects[body]
            else:
                label, position = world.labels[body], world.get_object_pose(body).position
            bin = _find_bin(position, bins)
            # For an item in a bin, a resumed run records the centre of the bin as first position.
            positions = [*positions, bins[bin].position] if bin else positions
            yield FinalObject(label, bin, positions, body in dropped_bodies, body == held_body, is_removed)

    return audit_objects(iterate_final_objects(), records, routes, max_distance)


def _find_bin(position: Array, bins: Mapping[str, Bin]) -> str | None:
    """Return the name of the bin that contains a position, "" outside of all bins, None below the table."""
    if position[2] < MIN_CENTRE_HEIGHT:
        return None
    # The centre of an object that leans on a bin wall may be above the wall.
    return next((name for name, bin in bins.items() if bin.contains(position, BIN_THICKNESS)), "")
