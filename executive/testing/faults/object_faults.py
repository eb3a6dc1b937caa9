"""Faults of objects: an object is removed, displaced or bumped aside, or cannot be sealed."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from executive.errors import InputError
from executive.testing.faults.effect import Effect, FaultScene, ObjectChoice, Occurrence, validate_fraction
from executive.testing.faults.world_access import TrueObject

BUMP_DISTANCE = 0.06
"""Displacement of an object that is bumped aside [m]."""
BUMP_DIRECTION_COUNT = 8
"""Number of evenly spaced directions that are tried, in order, for a free place for a bumped object."""
MAX_TOOL_DISTANCE = 0.03
"""Maximum horizontal distance between tool and object if the tool touches the object [m]."""

Pair = tuple[float, float]
"""Components `(x, y)` of a displacement [m], or minimum and maximum of a coordinate [m]."""


def object_removed(choice: ObjectChoice = "node", fraction: float | None = None) -> Effect:
    """Return an effect: an object is removed once, also if the tool holds it.

    Args:
        choice: Number of the object from 1, `nearest` to the tool, or the object of the `node`.
        fraction: Fraction of the motion of the arm after which the effect begins, 0 to 1; None: at once.

    Raises:
        InputError: The number of the object or the fraction is out of range.
    """
    return _make_object_effect("object_removed", _remove_object, choice, fraction)


def object_moved(displacement: Pair, choice: ObjectChoice = "node", fraction: float | None = None) -> Effect:
    """Return an effect: an object is displaced once.

    Args:
        displacement: Displacement along x and y [m]; a simulated object at the destination is pushed aside.
        choice: Number of the object from 1, `nearest` to the tool, or the object of the `node`.
        fraction: Fraction of the motion of the arm after which the effect begins, 0 to 1; None: at once.

    Raises:
        InputError: The number of the object or the fraction is out of range.
    """
    return _make_object_effect("object_moved", _move_object, choice, fraction, displacement)


def object_bumped(x: Pair, y: Pair, choice: ObjectChoice = "node", fraction: float | None = None) -> Effect:
    """Return an effect: an object is bumped aside once, by `BUMP_DISTANCE`, to a free place.

    Args:
        x: Allowed interval of x of the new place [m].
        y: Allowed interval of y of the new place [m].
        choice: Number of the object from 1, `nearest` to the tool, or the object of the `node`.
        fraction: Fraction of the motion of the arm after which the effect begins, 0 to 1; None: at once.

    Raises:
        InputError: The number of the object or the fraction is out of range.
    """
    return _make_object_effect("object_moved", _bump_object, choice, fraction, x, y)


def object_unsealable(number: int) -> Effect:
    """Return an effect: the suction cup cannot seal on one object.

    Args:
        number: Number of the object, from 1.
    """
    return Effect("seal_fails", interceptors={"close": _prevent_seal}, arguments=(number,))


def _make_object_effect(
    name: str, change: Callable[..., bool], choice: ObjectChoice, fraction: float | None, *values: Pair
) -> Effect:
    """Return an effect that calls `change(occurrence, object, *values)` once."""
    if isinstance(choice, int) and choice < 1:
        raise InputError(f"the number of an object must be at least 1, not {choice}")
    return Effect(name, _change_object, arguments=(change, choice, validate_fraction(fraction), *values))


def _change_object(
    occurrence: Occurrence, change: Callable[..., bool], choice: ObjectChoice, fraction: float, *values: Pair
) -> bool:
    """Change the object if the arm has completed `fraction` of its motion; return True if changed."""
    scene = occurrence.scene
    affected = None if scene.motion_progress < fraction else scene.find_object(choice, occurrence.item)
    return affected is not None and change(occurrence, affected, *values)


def _remove_object(occurrence: Occurrence, removed: TrueObject) -> bool:
    occurrence.emit_event(removed)
    occurrence.scene.world.remove(removed)
    return True


def _move_object(occurrence: Occurrence, moved: TrueObject, displacement: Pair) -> bool:
    occurrence.emit_event(moved)
    occurrence.scene.world.move(moved, displacement)
    return True


def _bump_object(occurrence: Occurrence, bumped: TrueObject, x: Pair, y: Pair) -> bool:
    displacement = _find_free_displacement(occurrence.scene, bumped, x, y)
    return displacement is not None and _move_object(occurrence, bumped, displacement)


def _find_free_displacement(scene: FaultScene, bumped: TrueObject, x: Pair, y: Pair) -> Pair | None:
    """Return the displacement `(x, y)` [m] of an object to a free place; None if there is none."""
    radius = scene.cell.classes[bumped.label].radius
    others = [
        (other.position[:2], scene.cell.classes[other.label].radius + radius)
        for other in scene.world.objects
        if other.body != bumped.body
    ]
    for index in range(BUMP_DIRECTION_COUNT):
        angle = 2 * math.pi * index / BUMP_DIRECTION_COUNT
        displacement = np.array([math.cos(angle), math.sin(angle)]) * BUMP_DISTANCE
        place = bumped.position[:2] + displacement
        is_inside = x[0] <= place[0] <= x[1] and y[0] <= place[1] <= y[1]
        if is_inside and all(math.dist(place, other) > distance for other, distance in others):
            return float(displacement[0]), float(displacement[1])
    return None


def _prevent_seal(proceed: Callable[[], None], occurrence: Occurrence, number: int) -> None:
    """Close the tool, unless the tool touches the object with this number."""
    unsealable = occurrence.scene.find_object(number, "")
    tool = occurrence.scene.cell.arm.tool_pose.position
    if unsealable is None or math.dist(unsealable.position[:2], tool[:2]) > MAX_TOOL_DISTANCE:
        proceed()
    else:
        occurrence.emit_event(unsealable)
