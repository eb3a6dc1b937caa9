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
    """Return the objects on the table and in the bins as obstacles, except the item `excluded_item`."""
    targets = [target for target in cell.ledger.find_objects_on_table() if target.item != excluded_item]
    return (*(make_obstacle(cell, target) for target in targets), *_list_bin_obstacles(cell, excluded_item))


def is_detection_in_bin(cell: Cell, detection: Detection, frame: Frame) -> bool:
    """Return True if a detected object lies in a bin or on its walls; False if the depth is unknown."""
    try:
        position = cell.localizer.locate(detection, frame)
    except NoDepth:
        return False
    return any(bin.contains(position, BIN_THICKNESS) for bin in cell.bins.values())


def predict_object_count(
    cell: Cell, bin_name: str, excluded_item: Item | None = None, *, label: str | None = None
) -> int:
    """Return the number of objects in a bin, including an item that the arm is moving into the bin.

    A plan with this number remains valid after the release. A moving `excluded_item` is not counted. `label`
    restricts the count to one class.
    """
    held_item = cell.ledger.find_held_item()
    is_counted = held_item is not None and held_item != excluded_item
    if held_item is not None and label is not None:
        is_counted = is_counted and cell.ledger.get_label(held_item) == label
    # Without a moving item, the destination is not read, because each reading of the cell is recorded.
    arriving_count = 1 if is_counted and cell.bins[bin_name].contains(cell.arm.destination) else 0
    return cell.ledger.count_objects_in(bin_name, label) + arriving_count


def predict_used_slots(cell: Cell, bin_name: str, excluded_item: Item | None = None) -> int:
    """Return the number of used slots of a bin, as `predict_object_count` returns the number of objects."""
    vacated_count = cell.ledger.count_used_slots(bin_name) - cell.ledger.count_objects_in(bin_name)
    return vacated_count + predict_object_count(cell, bin_name, excluded_item)


def make_obstacle(cell: Cell, target: Target) -> Obstacle:
    """Return the bounding cylinder of a target as an obstacle."""
    x, y, z = map(float, target.position)
    object_class = cell.classes[target.label]
    return Obstacle(x, y, object_class.radius, z + object_class.height / 2, target.item)


def find_max_object_height(cell: Cell) -> float:
    """Return the height of the tallest class of objects [m]."""
    return max(object_class.height for object_class in cell.classes.values())


def compute_layer_height(bin: Bin, layer: int, max_object_height: float) -> float:
    """Return the height of the underside of a layer of objects in a bin [m]; layer 0 lies on the floor."""
    return float(bin.position[2]) + BIN_THICKNESS + layer * max_object_height


def _list_bin_obstacles(cell: Cell, excluded_item: Item | None) -> Iterator[Obstacle]:
    """Yield a cylinder up to the top layer for each slot with objects; `excluded_item` is not counted."""
    radius = max(object_class.radius for object_class in cell.classes.values()) + MAX_ROLL_DISTANCE
    for bin_name, bin in cell.bins.items():
        used_slots = predict_used_slots(cell, bin_name, excluded_item)
        for index, (x, y) in enumerate(bin.slots[:used_slots]):
            # Objects fill the slots of a layer in order, before the next layer begins.
            layer_count = math.ceil((used_slots - index) / len(bin.slots))
            top = compute_layer_height(bin, layer_count, find_max_object_height(cell))
            yield Obstacle(float(x), float(y), radius, top, f"the objects in slot {index + 1} of {bin_name}")
