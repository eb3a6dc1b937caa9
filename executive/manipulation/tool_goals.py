"""Goals of the tool: on an object, over a slot of a bin, over a free place on the table."""

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
    count_used_slots,
    layer_height,
    list_obstacles,
    make_obstacle,
    max_object_height,
)

DROP_HEIGHT = 0.01
"""Default height of an item's underside above the floor of a bin, or the layer of objects there, at its
release [m]."""
OVERTRAVEL = 0.015
"""Default depth below the expected surface down to which an approach searches for contact [m]."""
PROBE_CLEARANCE = 0.005
"""Height above the table down to which later attempts search for contact [m]."""
ATTEMPTS_BEFORE_PROBE = 3
"""Number of failed attempts after which an approach descends almost to the table."""
SPIRAL_SPACING = 0.0025
"""Default spacing of the spiral of contact points of further attempts [m]."""
MIN_GAP = 0.02
"""Smallest distance between the outlines of an object that is put down and of its neighbours [m]."""
PLACES_PER_SIDE = 2
"""Number of candidate places on each side of the safe place for a put-down."""
GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))
"""Angle between two successive points of a Vogel spiral [rad]."""


def approach(
    cell: Cell, target: Target, overtravel: float = OVERTRAVEL, spacing: float = SPIRAL_SPACING
) -> tuple[Goal, Task]:
    """Return goal and task of an approach to a point below the surface of `target`.

    The last part of the motion is guarded: the arm stops on contact. Each further attempt is offset from the
    previous one. From the fourth attempt on, the motion ends almost at the table: without a contact, the item
    is a false detection.

    Args:
        cell: The work cell.
        target: Target to touch.
        overtravel: Depth below the expected surface down to which the first attempts search for contact [m];
            limited to half of the height.
        spacing: Spacing of the spiral of further attempts [m].
    """
    goal = goal_on_object(
        cell.classes[target.label],
        target.position,
        cell.descent,
        cell.descent_speed,
        attempt=cell.ledger.count_attempts(target.item),
        overtravel=overtravel,
        spacing=spacing,
    )
    return goal, Task(around=list_obstacles(cell, target.item), target=make_obstacle(cell, target))


def goal_on_object(
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
        overtravel: See `approach`.
        spacing: See `approach`.
    """
    x, y, middle = (float(value) for value in position)
    dx, dy = _attempt_offset(attempt, kind.ring, spacing)
    surface = middle + kind.height / 2
    lowest = lowest_contact(kind, middle, overtravel)
    if attempt >= ATTEMPTS_BEFORE_PROBE:
        lowest = min(lowest, middle - kind.height / 2 + PROBE_CLEARANCE)
    return Goal((x + dx, y + dy, lowest), guarded=surface + descent - lowest, speed=descent_speed)


def lowest_contact(kind: ObjectClass, middle: float, overtravel: float) -> float:
    """Return the lowest height of a contact that may be the top of an object [m].

    Args:
        kind: Class of the object.
        middle: Height of its centre [m].
        overtravel: See `approach`.
    """
    return max(middle + kind.height / 2 - overtravel, middle)


def nearest_first(cell: Cell, targets: Sequence[Target]) -> list[Target]:
    """Return the targets that can be picked, in the order of their distance from the arm's destination.

    A target can be picked if its item is open and certain, its class has a route, and nothing may have moved
    the item since its last detection.
    """
    ledger, here = cell.ledger, cell.arm.destination[:2]
    possible = [
        target
        for target in targets
        if ledger.is_open(target.item)
        and ledger.is_fresh(target)
        and ledger.is_certain(target.item)
        and ledger.get_label(target.item) in cell.routes
    ]
    return sorted(possible, key=lambda t: (float(np.linalg.norm(t.position[:2] - here)), t.item))


def goal_in_bin(cell: Cell, bin: str, item: Item, drop: float = DROP_HEIGHT) -> Goal:
    """Return the goal of a transit: `drop` [m] above the next free slot of a bin, or the layer there."""
    height = cell.classes[cell.ledger.get_label(item)].height
    return goal_over_slot(
        cell.bins[bin], count_used_slots(cell, bin, item), height, max_object_height(cell), drop
    )


def goal_over_slot(
    bin: Bin, number: int, height: float, max_object_height: float, drop: float = DROP_HEIGHT
) -> Goal:
    """Return the goal of a transit over a slot of a bin.

    Args:
        bin: The bin.
        number: Number of objects in the bin before; with every slot used, the next layer begins.
        height: Height of the carried object [m].
        max_object_height: Height of the tallest objects that may lie in a layer below [m].
        drop: Height of the underside of the carried object above that layer, or the floor [m].
    """
    layer, slot = divmod(number, len(bin.slots))
    x, y = (float(value) for value in bin.slots[slot])
    return Goal((x, y, layer_height(bin, layer, max_object_height) + height + drop))


def goal_aside(cell: Cell, kind: ObjectClass, drop: float, item: Item | None = None) -> Goal:
    """Return the goal of a put-down: `drop` [m] above the free place nearest to the safe place.

    A place is free if neither an obstacle nor a bin is there. If no candidate is free, the goal is the safe
    place. The obstacles do not include `item`.
    """
    pitch = 2 * kind.radius + MIN_GAP
    x, y, floor = (float(value) for value in cell.safe_place)
    offsets = [step * pitch for step in range(-PLACES_PER_SIDE, PLACES_PER_SIDE + 1)]
    nearest = sorted(product(offsets, offsets), key=lambda offset: math.hypot(*offset))
    places = [(x + dx, y + dy) for dx, dy in nearest]
    radius = kind.radius + MIN_GAP
    place = next((place for place in places if _is_free(cell, np.array(place), radius, item)), (x, y))
    return Goal((*place, floor + kind.height + drop))


def _is_free(cell: Cell, place: Array, radius: float, excluded: Item | None) -> bool:
    """Return True if nothing but `excluded` is within `radius` [m] of a place `(2,)` [m] on the table."""
    if any(bin.contains(place, radius + BIN_THICKNESS) for bin in cell.bins.values()):
        return False
    return all(
        math.dist(place, (obstacle.x, obstacle.y)) > radius + obstacle.radius
        for obstacle in list_obstacles(cell, excluded)
    )


def _attempt_offset(attempt: int, ring: float, spacing: float) -> tuple[float, float]:
    """Return the horizontal offset (x, y) [m] of an attempt: a point of the ring, or of a Vogel spiral.

    The orientation of a part is unknown, and each point of its ring is equally suitable. The spiral begins
    at the centre.
    """
    angle = attempt * GOLDEN_ANGLE
    distance = ring or spacing * math.sqrt(attempt)
    return distance * math.cos(angle), distance * math.sin(angle)
