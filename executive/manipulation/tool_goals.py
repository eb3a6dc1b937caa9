"""Goals of the tool: on an object, over a slot of a bin, and over a free position on the table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import numpy as np

from executive.cell.arm import Goal, Task
from executive.cell.bins import BIN_THICKNESS, Bin
from executive.cell.objects import Item, ObjectClass, Target
from executive.cell.protocols import Cell
from executive.geometry import Array
from executive.manipulation.obstacles import (
    compute_layer_height,
    count_used_slots,
    find_max_object_height,
    list_obstacles,
    make_obstacle,
)

DROP_HEIGHT = 0.01
"""Default height from which an item is dropped into a bin: distance from its underside to the floor or to the
layer of objects below [m]."""
OVERTRAVEL = 0.015
"""Default depth below the expected surface down to which an approach searches for contact [m]."""
PROBE_CLEARANCE = 0.005
"""Height above the table at which an approach ends after `ATTEMPTS_BEFORE_PROBE` failed attempts [m]."""
ATTEMPTS_BEFORE_PROBE = 3
"""Number of failed attempts after which an approach descends almost to the table."""
SPIRAL_SPACING = 0.0025
"""Default distance between the contact points of successive attempts, which form a spiral [m]."""
MIN_GAP = 0.02
"""Minimum distance between the outlines of an object that is put down and of its neighbours [m]."""
POSITIONS_PER_SIDE = 2
"""Number of candidate positions for a put-down on each side of the safe place."""
GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))
"""Angle between two successive points of a Vogel spiral [rad]."""


def make_approach(
    cell: Cell, target: Target, overtravel: float = OVERTRAVEL, spacing: float = SPIRAL_SPACING
) -> tuple[Goal, Task]:
    """Return goal and task of an approach to a point below the surface of `target`.

    The last part of the motion is guarded: the arm stops on contact. Each attempt has another horizontal
    offset. From the fourth attempt on, the motion ends almost at the table, because the item may be a false
    detection.

    Args:
        cell: The work cell.
        target: Target to touch.
        overtravel: Depth below the expected surface down to which the first attempts search for contact [m];
            at most half of the object's height is used.
        spacing: Distance between the contact points of successive attempts [m].
    """
    goal = make_object_goal(
        cell.classes[target.label],
        target.position,
        cell.descent,
        cell.descent_speed,
        attempt=cell.ledger.count_attempts(target.item),
        overtravel=overtravel,
        spacing=spacing,
    )
    return goal, Task(obstacles=list_obstacles(cell, target.item), target=make_obstacle(cell, target))


def make_object_goal(
    kind: ObjectClass,
    position: Array,
    descent: float,
    descent_speed: float,
    *,
    attempt: int = 0,
    overtravel: float = OVERTRAVEL,
    spacing: float = SPIRAL_SPACING,
) -> Goal:
    """Return the goal of an approach to an object.

    Args:
        kind: Class of the object.
        position: Centre of the object `(3,)` [m].
        descent: Length of the guarded part above the expected surface [m].
        descent_speed: Tool speed of the guarded part [m/s].
        attempt: Number of failed attempts before this one.
        overtravel: Depth below the expected surface down to which the first attempts search for contact [m].
        spacing: Distance between the contact points of successive attempts [m].
    """
    x, y, z = (float(value) for value in position)
    dx, dy = _compute_attempt_offset(attempt, kind.ring, spacing)
    surface = z + kind.height / 2
    lowest = compute_lowest_contact(kind, z, overtravel)
    if attempt >= ATTEMPTS_BEFORE_PROBE:
        lowest = min(lowest, z - kind.height / 2 + PROBE_CLEARANCE)
    return Goal(
        (x + dx, y + dy, lowest), guarded_length=surface + descent - lowest, guarded_speed=descent_speed
    )


def compute_lowest_contact(kind: ObjectClass, centre_height: float, overtravel: float) -> float:
    """Return the lowest contact height that counts as a contact with the top of an object [m].

    Args:
        kind: Class of the object.
        centre_height: Height of the centre of the object [m].
        overtravel: Maximum depth of the contact below the expected surface [m].
    """
    return max(centre_height + kind.height / 2 - overtravel, centre_height)


def sort_pickable_targets(cell: Cell, targets: Sequence[Target]) -> list[Target]:
    """Return the targets that can be picked, in the order of their distance from the arm's destination.

    A target can be picked if its item is unsorted and certain, cannot have moved since its last detection,
    and has a class with a route.
    """
    ledger, arm_position = cell.ledger, cell.arm.destination[:2]
    pickable = [
        target
        for target in targets
        if ledger.is_open(target.item)
        and ledger.is_fresh(target)
        and ledger.is_certain(target.item)
        and ledger.get_label(target.item) in cell.routes
    ]
    return sorted(pickable, key=lambda t: (float(np.linalg.norm(t.position[:2] - arm_position)), t.item))


def make_bin_goal(cell: Cell, bin: str, item: Item, drop_height: float = DROP_HEIGHT) -> Goal:
    """Return the goal of a transit: the item is `drop_height` [m] above the next free slot of a bin."""
    height = cell.classes[cell.ledger.get_label(item)].height
    return make_slot_goal(
        cell.bins[bin], count_used_slots(cell, bin, item), height, find_max_object_height(cell), drop_height
    )


def make_slot_goal(
    bin: Bin, count: int, height: float, max_object_height: float, drop_height: float = DROP_HEIGHT
) -> Goal:
    """Return the goal of a transit over the next free slot of a bin.

    Args:
        bin: The bin.
        count: Number of objects in the bin; a new layer begins if all slots are used.
        height: Height of the object in the tool [m].
        max_object_height: Height of the tallest objects that may lie in a lower layer [m].
        drop_height: Height of the underside of the object above the lower layer or the floor [m].
    """
    layer, slot = divmod(count, len(bin.slots))
    x, y = (float(value) for value in bin.slots[slot])
    return Goal((x, y, compute_layer_height(bin, layer, max_object_height) + height + drop_height))


def make_put_down_goal(cell: Cell, kind: ObjectClass, drop_height: float, item: Item | None = None) -> Goal:
    """Return the goal of a put-down: `drop_height` [m] above the free position nearest to the safe place.

    A position is free if it is neither in an obstacle (except `item`) nor in a bin. If no candidate is free,
    the goal is over the safe place.
    """
    pitch = 2 * kind.radius + MIN_GAP
    x, y, floor = (float(value) for value in cell.safe_place)
    offsets = [step * pitch for step in range(-POSITIONS_PER_SIDE, POSITIONS_PER_SIDE + 1)]
    nearest = sorted(product(offsets, offsets), key=lambda offset: math.hypot(*offset))
    candidates = [(x + dx, y + dy) for dx, dy in nearest]
    radius = kind.radius + MIN_GAP
    free = (candidate for candidate in candidates if _is_free(cell, np.array(candidate), radius, item))
    return Goal((*next(free, (x, y)), floor + kind.height + drop_height))


def _is_free(cell: Cell, position: Array, radius: float, excluded: Item | None) -> bool:
    """Return True if no bin, and no item but `excluded`, is within `radius` [m] of a position `(2,)` [m]."""
    if any(bin.contains(position, radius + BIN_THICKNESS) for bin in cell.bins.values()):
        return False
    return all(
        math.dist(position, (obstacle.x, obstacle.y)) > radius + obstacle.radius
        for obstacle in list_obstacles(cell, excluded)
    )


def _compute_attempt_offset(attempt: int, ring: float, spacing: float) -> tuple[float, float]:
    """Return the horizontal offset (x, y) [m] of an attempt: a point on a circle, or on a Vogel spiral.

    If `ring` [m] is not 0, it is the radius of the circle: the orientation of the part is unknown, and all
    points of the circle are equally suitable. The spiral begins at the centre of the object.
    """
    angle = attempt * GOLDEN_ANGLE
    distance = ring or spacing * math.sqrt(attempt)
    return distance * math.cos(angle), distance * math.sin(angle)
