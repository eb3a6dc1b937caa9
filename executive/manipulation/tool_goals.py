"""Goals of the tool (surfaces of objects, slots of bins, free positions on the table), obstacles, tours."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np

from executive.cell.arm import Goal
from executive.cell.frame import Detection, Frame
from executive.cell.objects import BIN_THICKNESS, Bin, Item, ObjectClass, Obstacle, Target, is_quota_reached
from executive.cell.protocols import Cell
from executive.errors import NoDepth

MAX_ROLL_DISTANCE = 0.002
"""Maximum distance that an object rolls in a bin after its release [m]."""
DROP_HEIGHT = 0.01
"""Default clearance between an item and the surface below at the release [m]."""
MAX_PRESSING_DISTANCE = 0.003
"""Distance by which the descent of a put-down continues below the expected contact with the table [m]."""
MIN_GAP = 0.02
"""Minimum gap between the object in the tool and other objects after a put-down [m]."""
GRID_HALF_WIDTH = 2
"""Half width of the grid of candidate positions around `cell.safe_place`, where objects are put down [grid
steps]."""


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
    x, y, z = map(float, target.pose_at(target.stamp).position)
    object_class = cell.classes.get(target.label)
    classes = [object_class] if object_class else cell.classes.values()
    radius = max(each.radius for each in classes)
    height = max(each.height for each in classes)
    # A wrong depth image shows objects below the table, on which they cannot lie.
    return Obstacle(x, y, radius, max(z + height / 2, height), target.item)


def find_max_object_height(cell: Cell) -> float:
    """Return the height of the tallest class of objects [m]."""
    return max(object_class.height for object_class in cell.classes.values())


def find_layer_thickness(cell: Cell, bin_name: str) -> float:
    """Return the thickness of a layer of objects in a bin [m]: the height of the tallest class.

    In a bin with `place_yaw_deg`, only the classes count that are routed to the bin or lie in it, so that the
    parts of a layer stand on those below.
    """
    if not cell.bins[bin_name].place_yaws:
        return find_max_object_height(cell)
    heights = [
        object_class.height
        for label, object_class in cell.classes.items()
        if bin_name in cell.routes.get(label, ()) or cell.ledger.count_objects_in(bin_name, label)
    ]
    return max(heights, default=find_max_object_height(cell))


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
        thickness = find_layer_thickness(cell, bin_name)
        for index, (x, y) in enumerate(bin.slots[:next_slot_index]):
            # Objects fill the slots of a layer in order, before the next layer begins.
            layer_count = math.ceil((next_slot_index - index) / len(bin.slots))
            top = compute_layer_height(bin, layer_count, thickness)
            yield Obstacle(float(x), float(y), radius, top, f"the objects in slot {index + 1} of {bin_name}")


def sort_pickable_targets(cell: Cell, targets: Sequence[Target]) -> list[Target]:
    """Return the targets that can be picked, sorted by their distance from the destination of the arm.

    A target can be picked if its item is open, class and position of the item are certain, a bin below its
    quota is permitted for the item, and the robot cannot have moved the item since its detection.
    """
    ledger = cell.ledger
    destination = cell.arm.destination[:2]
    pickable_targets = [
        target
        for target in targets
        if ledger.describe(target.item).is_open
        and ledger.is_fresh(target)
        and ledger.is_certain(target.item)
        and choose_bin(cell, target.item)
    ]
    offsets = {target.item: target.position[:2] - destination for target in pickable_targets}
    return sorted(pickable_targets, key=lambda target: (np.linalg.norm(offsets[target.item]), target.item))


def choose_bin(cell: Cell, item: Item) -> str:
    """Return the first free bin with a quota, else the free bin with the fewest objects, else "".

    A bin is free if it is permitted for the class of the item, its quota is not reached, and images do not
    contradict it. An item that the arm is moving into a bin counts as an object in the bin. If the class of
    the item is not certain by its weight, and has no free bin, the function chooses a bin of a class that
    looks alike.
    """
    count_objects = partial(predict_object_count, cell)
    for label in cell.ledger.list_possible_labels(item):
        contradicted_bins = cell.ledger.contradicted_bins
        bins = [bin for bin in cell.routes.get(label, ()) if bin not in contradicted_bins]
        free_bins = [bin for bin in bins if not is_quota_reached(cell.quotas, bin, label, count_objects)]
        limited_bins = [bin for bin in free_bins if {(bin, None), (bin, label)} & cell.quotas.keys()]
        if free_bins:
            return limited_bins[0] if limited_bins else min(free_bins, key=count_objects)
    return ""


def explain_uncertain_bin(cell: Cell, bin_name: str, item: Item) -> str:
    """Return the reason why a bin may be wrong for `item`, or "".

    The bin may be wrong if it is permitted for only some of the classes that look like the item, and no
    weighing determined the class. If the bin is permitted for none of these classes, the mission chose the
    bin on purpose, and the result is "".
    """
    possible_labels = cell.ledger.list_possible_labels(item)
    labels = [label for label in cell.classes if label in possible_labels]
    other_labels = [label for label in labels if bin_name not in cell.routes.get(label, ())]
    if len(other_labels) in (0, len(labels)):
        return ""
    return (
        f"{item} may be a {' or a '.join(labels)}, which look alike, and {bin_name} is not permitted for a "
        f"{' or a '.join(other_labels)}; weigh the item before the transit"
    )


def make_slot_goal(
    bin: Bin, slot_index: int, hold_height: float, max_object_height: float, drop_height: float = DROP_HEIGHT
) -> Goal:
    """Return the goal of a transit to a position above the next slot of a bin.

    Args:
        bin: The bin.
        slot_index: Index of the next slot; a new layer begins after the last slot of the bin.
        hold_height: Distance from the tool centre point down to the underside of the object [m].
        max_object_height: Height of the tallest object in the bin, and thickness of each layer [m].
        drop_height: Height of the object's underside above the layer below, or above the floor [m].
    """
    layer, index_in_layer = divmod(slot_index, len(bin.slots))
    x, y = map(float, bin.slots[index_in_layer])
    return Goal((x, y, compute_layer_height(bin, layer, max_object_height) + hold_height + drop_height))


def make_put_down_goal(cell: Cell, object_class: ObjectClass, drop_height: float, item: Item | None) -> Goal:
    """Return the goal of a put-down: a guarded descent of an object to a free position on the table.

    The descent begins `drop_height` [m] above the table. The position is the nearest free and reachable
    candidate to `cell.safe_place`; if none, `cell.safe_place`. `item` is the item in the tool, which is no
    obstacle; None if the ledger knows no item there.
    """
    x, y, table_height = map(float, cell.safe_place)
    grid_spacing = 2 * object_class.radius + MIN_GAP
    offsets = [step * grid_spacing for step in range(-GRID_HALF_WIDTH, GRID_HALF_WIDTH + 1)]
    sorted_offsets = sorted(product(offsets, offsets), key=lambda offset: math.hypot(*offset))
    candidates = ((x + dx, y + dy) for dx, dy in sorted_offsets)
    free_positions = (xy for xy in candidates if _is_free(cell, xy, object_class.radius + MIN_GAP, item))
    hold_height = cell.tool_model.get_hold_height(object_class)
    # The tips of fingers must not press on the table instead of the object.
    space = hold_height + cell.tool_model.list_parts(0.0)[-1].offset - cell.motion.margin
    pressing_distance = min(max(space, 0.0), MAX_PRESSING_DISTANCE)
    goal = Goal(
        (x, y, table_height + hold_height - pressing_distance),
        guarded_length=drop_height + pressing_distance,
        guarded_speed=cell.motion.descent_speed,
    )
    goals = (replace(goal, position=(*xy, goal.position[2])) for xy in free_positions)
    return next((each for each in goals if not cell.arm.describe_unreachable(each)), goal)


def _is_free(cell: Cell, position: tuple[float, float], min_distance: float, item: Item | None) -> bool:
    """Return True if all bins, and all objects except `item`, are `min_distance` [m] away from `position`."""
    bins = cell.bins.values()
    return not any(bin.contains(np.array(position), min_distance + BIN_THICKNESS) for bin in bins) and all(
        math.dist(position, (obstacle.x, obstacle.y)) > min_distance + obstacle.radius
        for obstacle in list_obstacles(cell, item)
    )


def sort_by_tour(cell: Cell, targets: Sequence[Target]) -> list[Target]:
    """Return pickable targets, sorted by the length of the tour that begins with each target, shortest first.

    A tour leads from the destination of the arm to the first target, and from the bin of each target to the
    nearest of the remaining targets. The transports from the targets to their bins are not counted, because
    their total length is the same in all tours.
    """
    places = [cell.bins[choose_bin(cell, target.item)].position for target in targets]
    distances = [
        [math.dist(place[:2], target.position[:2]) for target in targets]
        for place in (cell.arm.destination, *places)
    ]
    lengths = {target.item: _measure_tour(distances, first) for first, target in enumerate(targets)}
    return sorted(targets, key=lambda target: (lengths[target.item], target.item))


def _measure_tour(distances: Sequence[Sequence[float]], first: int) -> float:
    """Return the length [m] of the tour that begins with a target.

    Args:
        distances: Horizontal distances of all targets [m]: row 0 from the start of the tour, row `i + 1` from
            the bin of target `i`.
        first: Index of the first target.
    """
    remaining = set(range(len(distances) - 1)) - {first}
    last = first
    length = distances[0][first]
    while remaining:
        row = distances[last + 1]
        last = min(remaining, key=lambda index: (row[index], index))
        length += row[last]
        remaining.remove(last)
    return length
