"""Final places of the bodies of a simulated world: ground truth, read only after a run."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

from executive.cell.bins import BIN_THICKNESS, Bin
from executive.cell.protocols import Routes
from executive.cells.audit import FinalObject, audit_objects
from executive.cells.sim.world import World
from executive.geometry import Array
from executive.ledger.item import Record

MIN_HEIGHT = -0.05
"""Height of a centre below which an object has left the table [m]."""


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
    """Return the counts of `executive.cells.audit.audit_objects` for the bodies of a simulated world.

    Args:
        world: The simulated world at the end of the run.
        stood: By body, its positions `(3,)` [m] at the start and after each time that it was moved by hand
            or released by the tool.
        records: The items of the ledger.
        bins: The bins of the cell.
        routes: Names of the right bins of each class.
        reach: Largest distance between the first position of an item and a position in `stood` [m].
        held: Body in the tool, or None.
        fallen: Bodies that fell from the tool and were not in it again.
    """

    def final_objects() -> Iterator[FinalObject]:
        for body, positions in stood.items():
            is_removed = body not in world.bodies
            label, position = (
                world.removed[body] if is_removed else (world.bodies[body], world.object_pose(body).position)
            )
            bin = _find_bin(position, bins)
            # A resumed run may see an object for the first time in a bin; the ledger takes its middle.
            places = [*positions, bins[bin].position] if bin else positions
            yield FinalObject(label, bin, places, body in fallen, body == held, is_removed)

    return audit_objects(final_objects(), records, routes, reach)


def _find_bin(position: Array, bins: Mapping[str, Bin]) -> str | None:
    """Return the name of the bin around a position, "" outside of all bins, None below the table."""
    if position[2] < MIN_HEIGHT:
        return None
    # The centre of an object that leans on a bin wall may be above the wall.
    return next((name for name, bin in bins.items() if bin.contains(position, BIN_THICKNESS)), "")
