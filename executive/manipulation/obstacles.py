"""What stands in the cell beyond what its file says: objects on the table and in the bins."""

from __future__ import annotations

from collections.abc import Iterator

from executive.cell.bins import BIN_THICKNESS, Bin
from executive.cell.detection import Detection
from executive.cell.frame import Frame
from executive.cell.objects import Item, Obstacle, Target
from executive.cell.protocols import Cell
from executive.errors import NoDepth

MAX_ROLL_DISTANCE = 0.002
"""How far an object in a bin may lie from where it was let go [m]."""


def list_obstacles(cell: Cell, but: Item | None = None) -> tuple[Obstacle, ...]:
    """Return what stands in the cell beyond what its file says, the item `but` left out.

    That is what the ledger believes on the table, and what lies in the bins (`count_used_slots`).
    """
    return (
        *(obstacle_of(cell, target) for target in cell.ledger.find_objects_on_table() if target.item != but),
        *_list_bin_contents(cell, but),
    )


def shows_bin_content(cell: Cell, detection: Detection, frame: Frame) -> bool:
    """Return True if a detection is at a position inside a bin or its walls."""
    try:
        position = cell.localizer.locate(detection, frame)
    except NoDepth:
        return False
    return any(bin.contains(position, BIN_THICKNESS) for bin in cell.bins.values())


def count_used_slots(cell: Cell, bin: str, but: Item | None = None) -> int:
    """Return how many objects lie in `bin`, the item `but` not counted: the number of its next free slot.

    What the tool carries into the bin counts, so that a plan made meanwhile still holds when it was let go.
    """
    held = cell.ledger.find_held_item()
    coming = held not in (None, but) and cell.bins[bin].contains(cell.arm.destination)
    return cell.ledger.count_in(bin) + coming


def obstacle_of(cell: Cell, target: Target) -> Obstacle:
    """Return what is in the way where a target stands."""
    x, y, middle = (float(value) for value in target.position)
    kind = cell.classes[target.label]
    return Obstacle(x, y, kind.radius, middle + kind.height / 2, target.item)


def max_object_height(cell: Cell) -> float:
    """Return the height of the tallest class of objects [m]."""
    return max(kind.height for kind in cell.classes.values())


def layer_height(bin: Bin, layer: int, max_object_height: float) -> float:
    """Return the height on which a layer of objects in a bin lies at most [m]; layer 0 is on the floor."""
    return float(bin.position[2]) + BIN_THICKNESS + layer * max_object_height


def _list_bin_contents(cell: Cell, but: Item | None) -> Iterator[Obstacle]:
    """Yield what stands on the slots of bins that were used, the item `but` left out."""
    widest, highest = max(kind.radius for kind in cell.classes.values()), max_object_height(cell)
    for name, box in cell.bins.items():
        count, slots = count_used_slots(cell, name, but), len(box.slots)
        for number, (x, y) in enumerate(box.slots[:count]):
            top = layer_height(box, (count - 1 - number) // slots + 1, highest)
            yield Obstacle(
                float(x),
                float(y),
                widest + MAX_ROLL_DISTANCE,
                top,
                f"what lies in slot {number + 1} of {name}",
            )
