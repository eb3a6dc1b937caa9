"""Obstacles that the cell file does not declare: objects on the table and in the bins."""

from __future__ import annotations

from collections.abc import Iterator

from executive.cell.bins import BIN_THICKNESS, Bin
from executive.cell.detection import Detection
from executive.cell.frame import Frame
from executive.cell.objects import Item, Obstacle, Target
from executive.cell.protocols import Cell
from executive.errors import NoDepth

MAX_ROLL_DISTANCE = 0.002
"""Maximum distance of an object in a bin from the position of its release [m]."""


def list_obstacles(cell: Cell, excluded: Item | None = None) -> tuple[Obstacle, ...]:
    """Return the objects on the table and in the bins as obstacles, without the item `excluded`."""
    targets = [target for target in cell.ledger.find_objects_on_table() if target.item != excluded]
    return (*(make_obstacle(cell, target) for target in targets), *_list_bin_contents(cell, excluded))


def is_detection_in_bin(cell: Cell, detection: Detection, frame: Frame) -> bool:
    """Return True if a detected object lies inside a bin or over its walls; False without a depth value."""
    try:
        position = cell.localizer.locate(detection, frame)
    except NoDepth:
        return False
    return any(bin.contains(position, BIN_THICKNESS) for bin in cell.bins.values())


def count_used_slots(cell: Cell, bin: str, excluded: Item | None = None) -> int:
    """Return the number of objects in `bin` without the item `excluded`, which is the index of the next slot.

    An item that the arm is moving into the bin counts, so that a plan remains valid after its release.
    """
    held = cell.ledger.find_held_item()
    is_arriving = held not in (None, excluded) and cell.bins[bin].contains(cell.arm.destination)
    return cell.ledger.count_objects_in(bin) + is_arriving


def make_obstacle(cell: Cell, target: Target) -> Obstacle:
    """Return the obstacle that a target is for the arm."""
    x, y, z = (float(value) for value in target.position)
    kind = cell.classes[target.label]
    return Obstacle(x, y, kind.radius, z + kind.height / 2, target.item)


def find_max_object_height(cell: Cell) -> float:
    """Return the height of the tallest class of objects [m]."""
    return max(kind.height for kind in cell.classes.values())


def compute_layer_height(bin: Bin, layer: int, max_object_height: float) -> float:
    """Return the maximum height of the underside of a layer of objects in a bin [m]; layer 0 is lowest."""
    return float(bin.position[2]) + BIN_THICKNESS + layer * max_object_height


def _list_bin_contents(cell: Cell, excluded: Item | None) -> Iterator[Obstacle]:
    """Yield an obstacle for each used slot of a bin, without the item `excluded`."""
    max_radius, max_height = max(kind.radius for kind in cell.classes.values()), find_max_object_height(cell)
    for name, bin in cell.bins.items():
        count, slots = count_used_slots(cell, name, excluded), len(bin.slots)
        for index, (x, y) in enumerate(bin.slots[:count]):
            top = compute_layer_height(bin, (count - 1 - index) // slots + 1, max_height)
            text = f"the objects in slot {index + 1} of {name}"
            yield Obstacle(float(x), float(y), max_radius + MAX_ROLL_DISTANCE, top, text)
