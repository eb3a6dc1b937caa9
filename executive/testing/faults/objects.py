"""Faults of objects: one is removed, moved or bumped aside, or does not seal to the tool."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from executive.errors import InputError
from executive.testing.faults.effect import Effect, Occasion, checked_share
from executive.testing.faults.hand import Thing
from executive.testing.faults.scene import FaultScene, Which

BUMP_DISTANCE = 0.06
"""Distance by which an object is bumped aside [m]."""
BUMP_DIRECTIONS = 8
"""Number of directions in which an object may be bumped; the first free one is taken."""
MAX_TOOL_OFFSET = 0.03
"""Horizontal distance between an object and the tool up to which the tool is on it [m]."""

Range = tuple[float, float]
"""Smallest and largest coordinate [m]."""


def object_removed(which: Which = "node", share: float | None = None) -> Effect:
    """Somebody takes an object away once, out of the tool too.

    Args:
        which: The object; by default the object of the node.
        share: Share of its motion that the arm has then behind it, 0 to 1; by default at once.

    Raises:
        InputError: The number or the share is out of range.
    """
    return Effect("object_removed", _remove, arguments=(_checked(which), checked_share(share)))


def object_moved(by: tuple[float, float], which: Which = "node", share: float | None = None) -> Effect:
    """Somebody puts an object elsewhere once.

    Args:
        by: Displacement along x and y [m]; an object that stands there is pushed aside, or flies.
        which: The object; by default the object of the node.
        share: Share of its motion that the arm has then behind it, 0 to 1; by default at once.

    Raises:
        InputError: The number or the share is out of range.
    """
    return Effect("object_moved", _move, arguments=(_checked(which), checked_share(share), by))


def object_bumped(x: Range, y: Range, which: Which = "node", share: float | None = None) -> Effect:
    """Something bumps an object aside once, to a free place.

    Args:
        x: Range in which the object stays [m].
        y: The same along y [m].
        which: The object; by default the object of the node.
        share: Share of its motion that the arm has then behind it, 0 to 1; by default at once.

    Raises:
        InputError: The number or the share is out of range.
    """
    return Effect("object_moved", _bump, arguments=(_checked(which), checked_share(share), x, y))


def object_refuses(number: int) -> Effect:
    """One object does not seal to the tool.

    Args:
        number: Number of the object, from 1.
    """
    return Effect("seal_fails", answers={"close": _refuse}, arguments=(number,))


def _checked(which: Which) -> Which:
    if isinstance(which, int) and which < 1:
        raise InputError(f"objects are counted from 1, and which is {which}")
    return which


def _find(now: Occasion, which: Which, share: float) -> Thing | None:
    """Return the object once the arm has this share of its motion behind it, or None."""
    return None if now.scene.progress < share else now.scene.find(which, now.item)


def _remove(now: Occasion, which: Which, share: float) -> bool:
    if (thing := _find(now, which, share)) is None:
        return False
    now.record(thing)
    now.scene.hand.remove(thing)
    return True


def _move(now: Occasion, which: Which, share: float, by: tuple[float, float]) -> bool:
    if (thing := _find(now, which, share)) is None:
        return False
    now.record(thing)
    now.scene.hand.move(thing, by)
    return True


def _bump(now: Occasion, which: Which, share: float, x: Range, y: Range) -> bool:
    thing = _find(now, which, share)
    by = None if thing is None else _find_free_place(now.scene, thing, x, y)
    return by is not None and _move(now, which, share, by)


def _find_free_place(scene: FaultScene, thing: Thing, x: Range, y: Range) -> tuple[float, float] | None:
    """Return the displacement of an object to a free place beside it [m], or None."""
    radius = scene.cell.classes[thing.label].radius
    others = [
        (other.position[:2], scene.cell.classes[other.label].radius + radius)
        for other in scene.hand.things
        if other.body != thing.body
    ]
    for number in range(BUMP_DIRECTIONS):
        angle = 2 * math.pi * number / BUMP_DIRECTIONS
        by = np.array([math.cos(angle), math.sin(angle)]) * BUMP_DISTANCE
        place = thing.position[:2] + by
        is_inside = x[0] <= place[0] <= x[1] and y[0] <= place[1] <= y[1]
        if is_inside and all(math.dist(place, other) > apart for other, apart in others):
            return float(by[0]), float(by[1])
    return None


def _refuse(proceed: Callable[[], None], now: Occasion, number: int) -> None:
    """Leave the tool as it is on this object."""
    thing = now.scene.find(number, "")
    here = now.scene.cell.arm.tool_pose.position
    if thing is None or math.dist(thing.position[:2], here[:2]) > MAX_TOOL_OFFSET:
        proceed()
    else:
        now.record(thing)
