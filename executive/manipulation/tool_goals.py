"""Where the arm goes to: onto an object, into a bin, to a free place on the table."""

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
    max_object_height,
    obstacle_of,
)

DROP_HEIGHT = 0.01
"""Height of an item's underside above a bin's floor, or the layer of objects there, when it is let go [m].

A mission may say otherwise.
"""
OVERTRAVEL = 0.015
"""How far below the expected surface an approach searches for contact, unless the mission sets it [m]."""
PROBE_CLEARANCE = 0.005
"""Height above the table down to which later attempts search for contact [m]."""
ATTEMPTS_BEFORE_PROBE = 3
"""Number of failed attempts after which an approach goes down almost to the table."""
SPIRAL_SPACING = 0.0025
"""Spacing of the spiral on which further attempts come down, unless a mission says otherwise [m]."""
MIN_GAP = 0.02
"""Room between the outlines of what is put down and what stands beside it [m]."""
PLACES_PER_SIDE = 2
"""How many places on each side of the safe one are considered for putting something down."""
GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))


def approach(
    cell: Cell, target: Target, overtravel: float = OVERTRAVEL, spacing: float = SPIRAL_SPACING
) -> tuple[Goal, Task]:
    """Return goal and task of an approach to a point below the surface of `target`.

    The last part of the motion is guarded: it stops on contact. Each further attempt comes down a little
    beside the previous one. From the fourth attempt on, the motion ends almost at the table: if the tool
    meets nothing, the item is a false detection.

    Args:
        cell: The work cell.
        target: What to touch.
        overtravel: How far below the expected surface the first attempts search for contact [m], but not
            below the target's middle.
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
    return goal, Task(around=list_obstacles(cell, target.item), target=obstacle_of(cell, target))


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
        kind: Its class.
        position: Its centre `(3,)` [m].
        descent: Length of the guarded part above its surface [m].
        descent_speed: Tool speed of that part [m/s].
        attempt: How many have failed before.
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
    """Return the targets that can be picked, in the order of their distance from where the arm will be.

    A target can be picked if its item is open, sure and of a class with a route, and nothing has put its
    position in doubt.
    """
    ledger, here = cell.ledger, cell.arm.destination[:2]
    possible = [
        target
        for target in targets
        if ledger.is_open(target.item)
        and ledger.is_fresh(target)
        and ledger.is_sure(target.item)
        and ledger.get_label(target.item) in cell.routes
    ]
    return sorted(possible, key=lambda t: (float(np.linalg.norm(t.position[:2] - here)), t.item))


def goal_in_bin(cell: Cell, bin: str, item: Item, drop: float = DROP_HEIGHT) -> Goal:
    """Return the goal of a transit: over the next free slot of a bin, `drop` [m] above what is there."""
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
        number: Of the slot; from the number of slots on, those of the next layer.
        height: Of what is carried [m].
        max_object_height: Height of the tallest objects that may lie in a layer below [m].
        drop: Of the underside above that layer, or the floor [m].
    """
    layer, place = divmod(number, len(bin.slots))
    x, y = (float(value) for value in bin.slots[place])
    return Goal((x, y, layer_height(bin, layer, max_object_height) + height + drop))


def goal_aside(cell: Cell, kind: ObjectClass, drop: float, item: Item | None = None) -> Goal:
    """Return the goal of putting an object down: `drop` [m] above the free place nearest the safe one.

    A place is free where nothing is believed to stand and no bin is; if none is far and wide, it is the safe
    place itself.
    """
    apart = 2 * kind.radius + MIN_GAP
    x, y, floor = (float(value) for value in cell.safe_place)
    steps = [step * apart for step in range(-PLACES_PER_SIDE, PLACES_PER_SIDE + 1)]
    places = [
        (x + dx, y + dy) for dx, dy in sorted(product(steps, steps), key=lambda step: math.hypot(*step))
    ]
    room = kind.radius + MIN_GAP
    place = next((place for place in places if _is_free(cell, np.array(place), room, item)), (x, y))
    return Goal((*place, floor + kind.height + drop))


def _is_free(cell: Cell, place: Array, radius: float, but: Item | None) -> bool:
    """Tell whether nothing else is within `radius` [m] of a place `(2,)` [m] on the table."""
    if any(bin.contains(place, radius + BIN_THICKNESS) for bin in cell.bins.values()):
        return False
    return all(
        math.dist(place, (obstacle.x, obstacle.y)) > radius + obstacle.radius
        for obstacle in list_obstacles(cell, but)
    )


def _attempt_offset(attempt: int, ring: float, spacing: float) -> tuple[float, float]:
    """Return the sideways step (x, y) [m] of an attempt: a point of the ring, or of Vogel's spiral.

    The turn of a part is not known, and any point of its ring is as good as another. The spiral begins in
    the middle.
    """
    angle = attempt * GOLDEN_ANGLE
    distance = ring or spacing * math.sqrt(attempt)
    return distance * math.cos(angle), distance * math.sin(angle)
