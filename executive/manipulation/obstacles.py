"""Obstacles that the cell file does not declare: objects on the table and in the bins."""

from __future__ import annotations

import math
from collections.abc import Iterator

from executive.cell.bins import BIN_THICKNESS, Bin
from executive.cell.detection import Detection
from executive.cell.frame import Frame
from executive.cell.objects import Item, Obstacle, Target
from executive.cell.protocols import Cell
from executive.errors import NoDepth

MAX_ROLL_DISTANCE = 0.002
"""Maximum distance that an object rolls in a bin after its release [m]."""


def list_obstacles(cell: Cell, excluded_item: Item | None = None) -> tuple[Obstacle, ...]:
    """Return the objects on the table and in the bins as obstacles, except the item `excluded_item`.

    An object of no item, such as what the arm ran into lately, is an obstacle as large as the largest class.
    """
    targets = [target for target in cell.ledger.find_objects_on_table() if target.item != excluded_item]
    return (*(make_obstacle(cell, target) for target in targets), *_list_bin_obstacles(cell, excluded_item))


def is_detection_in_bin(cell: Cell, detection: Detection, frame: Frame) -> bool:
    """Return True if a detected object lies in a bin or on its walls; False if the depth is unknown."""
    try:
        position = cell.localizer.locate(detection, frame)
    except NoDepth:
        return False
    return any(bin.contains(position, BIN_THICKNESS) for bin in cell.bins.values())


def predict_object_count(cell: Cell, bin_name: str, label: str | None = None) -> int:
    """Return the number of objects in a bin, including an item that the arm is moving into the bin.

    `label` restricts the count to one class.
    """
    arriving_item = _find_arriving_item(cell, bin_name)
    is_counted = arriving_item is not None and label in (None, cell.ledger.get_label(arriving_item))
    return cell.ledger.count_objects_in(bin_name, label) + is_counted


def predict_next_slot_index(cell: Cell, bin_name: str, excluded_item: Item | None = None) -> int:
    """Return the index of the next free slot of a bin, after the release of an item that the arm is moving.

    A plan with this index remains valid after the release. A moving `excluded_item` uses no slot.
    """
    arriving_item = _find_arriving_item(cell, bin_name, excluded_item)
    return cell.ledger.find_next_slot_index(bin_name) + (arriving_item is not None)


def make_obstacle(cell: Cell, target: Target) -> Obstacle:
    """Return the bounding cylinder of a target as an obstacle; of no class: as large as the largest class."""
    x, y, z = map(float, target.position)
    object_class = cell.classes.get(target.label)
    classes = [object_class] if object_class else cell.classes.values()
    radius, height = max(each.radius for each in classes), max(each.height for each in classes)
    return Obstacle(x, y, radius, z + height / 2, target.item)


def find_max_object_height(cell: Cell) -> float:
    """Return the height of the tallest class of objects [m]."""
    return max(object_class.height for object_class in cell.classes.values())


def compute_layer_height(bin: Bin, layer: int, max_object_height: float) -> float:
    """Return the height of the underside of a layer of objects in a bin [m]; layer 0 lies on the floor."""
    return float(bin.position[2]) + BIN_THICKNESS + layer * max_object_height


def _find_arriving_item(cell: Cell, bin_name: str, excluded_item: Item | None = None) -> Item | None:
    """Return the item that the arm is moving into a bin, or None; None also for `excluded_item`."""
    held_item = cell.ledger.find_held_item()
    # Without a moving item, the destination is not read, because each reading of the cell is recorded.
    if held_item in (None, excluded_item) or not cell.bins[bin_name].contains(cell.arm.destination):
        return None
    return held_item


def _list_bin_obstacles(cell: Cell, excluded_item: Item | None) -> Iterator[Obstacle]:
    """Yield a cylinder up to the top layer for each slot with objects; `excluded_item` is not counted."""
    radius = max(object_class.radius for object_class in cell.classes.values()) + MAX_ROLL_DISTANCE
    for bin_name, bin in cell.bins.items():
        next_slot_index = predict_next_slot_index(cell, bin_name, excluded_item)
        for index, (x, y) in enumerate(bin.slots[:next_slot_index]):
            # Objects fill the slots of a layer in order, before the next layer begins.
            layer_count = math.ceil((next_slot_index - index) / len(bin.slots))
            top = compute_layer_height(bin, layer_count, find_max_object_height(cell))
            yield Obstacle(float(x), float(y), radius, top, f"the objects in slot {index + 1} of {bin_name}")
