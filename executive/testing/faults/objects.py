"""Faults of objects: one is removed, moved or bumped aside, or does not seal to the tool."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from executive.errors import InputError
from executive.testing.faults.effect import Effect, FaultScene, ObjectChoice, Occurrence, require_share
from executive.testing.faults.world_access import TrueObject

BUMP_DISTANCE = 0.06
"""Distance by which an object is bumped aside [m]."""
BUMP_DIRECTIONS = 8
"""Number of directions in which an object may be bumped; the first free one is taken."""
MAX_TOOL_OFFSET = 0.03
"""Horizontal distance between an object and the tool up to which the tool is on the object [m]."""

Range = tuple[float, float]
"""Smallest and largest coordinate [m]."""


def object_removed(which: ObjectChoice = "node", share: float | None = None) -> Effect:
    """An object is removed once, from the tool if it is held.

    Args:
        which: The object: its number from 1, the `nearest` to the tool, or that of the `node`.
        share: Share of the arm's motion after which this happens, 0 to 1; by default at once.

    Raises:
        InputError: The number or the share is out of range.
    """
    return _object_effect("object_removed", _remove, which, share)


def object_moved(by: tuple[float, float], which: ObjectChoice = "node", share: float | None = None) -> Effect:
    """An object is displaced once.

    Args:
        by: Displacement along x and y [m]; an object at the new place is pushed aside.
        which: The object: its number from 1, the `nearest` to the tool, or that of the `node`.
        share: Share of the arm's motion after which this happens, 0 to 1; by default at once.

    Raises:
        InputError: The number or the share is out of range.
    """
    return _object_effect("object_moved", _move, which, share, by)


def object_bumped(x: Range, y: Range, which: ObjectChoice = "node", share: float | None = None) -> Effect:
    """An object is bumped aside once, to a free place.

    Args:
        x: Range of x of the place [m].
        y: Range of y of the place [m].
        which: The object: its number from 1, the `nearest` to the tool, or that of the `node`.
        share: Share of the arm's motion after which this happens, 0 to 1; by default at once.

    Raises:
        InputError: The number or the share is out of range.
    """
    return _object_effect("object_moved", _bump, which, share, x, y)


def object_refuses(number: int) -> Effect:
    """One object does not seal to the tool.

    Args:
        number: Number of the object, from 1.
    """
    return Effect("seal_fails", answers={"close": _prevent_seal}, arguments=(number,))


def _object_effect(
    name: str, change: Callable[..., bool], which: ObjectChoice, share: float | None, *arguments: Range
) -> Effect:
    """Return the effect of `change(occurrence, object, *arguments)`."""
    if isinstance(which, int) and which < 1:
        raise InputError(f"the number of an object is at least 1, not {which}")
    return Effect(name, _change_object, arguments=(change, which, require_share(share), *arguments))


def _change_object(
    occurrence: Occurrence, change: Callable[..., bool], which: ObjectChoice, share: float, *arguments: Range
) -> bool:
    """Change the object as soon as the arm has completed this share of its motion."""
    scene = occurrence.scene
    affected = None if scene.progress < share else scene.find(which, occurrence.item)
    return affected is not None and change(occurrence, affected, *arguments)


def _remove(occurrence: Occurrence, removed: TrueObject) -> bool:
    occurrence.record(removed)
    occurrence.scene.world.remove(removed)
    return True


def _move(occurrence: Occurrence, moved: TrueObject, by: tuple[float, float]) -> bool:
    occurrence.record(moved)
    occurrence.scene.world.move(moved, by)
    return True


def _bump(occurrence: Occurrence, bumped: TrueObject, x: Range, y: Range) -> bool:
    by = _find_free_displacement(occurrence.scene, bumped, x, y)
    return by is not None and _move(occurrence, bumped, by)


def _find_free_displacement(
    scene: FaultScene, bumped: TrueObject, x: Range, y: Range
) -> tuple[float, float] | None:
    """Return the displacement of an object to a free place beside it [m], or None."""
    radius = scene.cell.classes[bumped.label].radius
    others = [
        (other.position[:2], scene.cell.classes[other.label].radius + radius)
        for other in scene.world.objects
        if other.body != bumped.body
    ]
    for number in range(BUMP_DIRECTIONS):
        angle = 2 * math.pi * number / BUMP_DIRECTIONS
        by = np.array([math.cos(angle), math.sin(angle)]) * BUMP_DISTANCE
        place = bumped.position[:2] + by
        is_inside = x[0] <= place[0] <= x[1] and y[0] <= place[1] <= y[1]
        if is_inside and all(math.dist(place, other) > distance for other, distance in others):
            return float(by[0]), float(by[1])
    return None


def _prevent_seal(proceed: Callable[[], None], occurrence: Occurrence, number: int) -> None:
    """Close the tool, unless the tool is on this object."""
    refusing = occurrence.scene.find(number, "")
    tool = occurrence.scene.cell.arm.tool_pose.position
    if refusing is None or math.dist(refusing.position[:2], tool[:2]) > MAX_TOOL_OFFSET:
        proceed()
    else:
        occurrence.record(refusing)
