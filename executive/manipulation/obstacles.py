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
"""Maximum distance that an object rolls in a bin after its release [m]."""


def list_obstacles(cell: Cell, excluded: Item | None = None) -> tuple[Obstacle, ...]:
    """Return the objects on the table and in the bins as obstacles, without the item `excluded`."""
    targets = [target for target in cell.ledger.find_objects_on_table() if target.item != excluded]
    return (*(make_obstacle(cell, target) for target in targets), *_list_bin_obstacles(cell, excluded))


def is_detection_in_bin(cell: Cell, detection: Detection, frame: Frame) -> bool:
    """Return True if a detected object lies in a bin or over the walls of a bin; False without a depth."""
    try:
        position = cell.localizer.locate(detection, frame)
    except NoDepth:
        return False
    return any(bin.contains(position, BIN_THICKNESS) for bin in cell.bins.values())


def count_used_slots(cell: Cell, bin_name: str, excluded: Item | None = None) -> int:
    """Return the number of objects in a bin, without the item `excluded`.

    An item on its way into the bin counts, so that a plan remains valid after the release of this item.
    """
    held_item = cell.ledger.find_held_item()
    is_arriving = held_item not in (None, excluded) and cell.bins[bin_name].contains(cell.arm.destination)
    return cell.ledger.count_objects_in(bin_name) + is_arriving


def make_obstacle(cell: Cell, target: Target) -> Obstacle:
    """Return the object at a target as an obstacle."""
    x, y, z = map(float, target.position)
    object_class = cell.classes[target.label]
    return Obstacle(x, y, object_class.radius, z + object_class.height / 2, target.item)


def find_max_object_height(cell: Cell) -> float:
    """Return the height of the tallest class of objects [m]."""
    return max(object_class.height for object_class in cell.classes.values())


def compute_layer_height(bin: Bin, layer: int, max_object_height: float) -> float:
    """Return the height of a layer in a bin on objects of maximum height [m]; layer 0 lies on the floor."""
    return float(bin.position[2]) + BIN_THICKNESS + layer * max_object_height


def _list_bin_obstacles(cell: Cell, excluded: Item | None) -> Iterator[Obstacle]:
    """Yield an obstacle for each used slot of the bins, without the item `excluded`."""
    radius = max(object_class.radius for object_class in cell.classes.values()) + MAX_ROLL_DISTANCE
    for bin_name, bin in cell.bins.items():
        object_count = count_used_slots(cell, bin_name, excluded)
        for index, (x, y) in enumerate(bin.slots[:object_count]):
            # Objects fill the slots in order: this slot holds every len(bin.slots)-th object from `index` on.
            layers = len(range(index, object_count, len(bin.slots)))
            top = compute_layer_height(bin, layers, find_max_object_height(cell))
            description = f"the objects in slot {index + 1} of {bin_name}"
            yield Obstacle(float(x), float(y), radius, top, description)
