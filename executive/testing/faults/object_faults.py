"""Faults of objects: an object is removed, displaced or bumped aside, or cannot be sealed."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from executive.errors import InputError
from executive.geometry import Array
from executive.testing.faults.effect import Effect, FaultContext, ObjectChoice, Occurrence, validate_fraction
from executive.testing.faults.world_access import TrueObject

BUMP_DISTANCE = 0.06
"""Displacement of an object that is bumped aside [m]."""
BUMP_DIRECTION_COUNT = 8
"""Number of evenly spaced directions that are tried, in order, for a free position of a bumped object."""
MAX_TOOL_DISTANCE = 0.03
"""Maximum horizontal distance between tool and object if the tool touches the object [m]."""

Displacement = tuple[float, float]
"""Components `(x, y)` of a displacement [m]."""
Interval = tuple[float, float]
"""Minimum and maximum of a coordinate [m]."""


def object_removed(choice: ObjectChoice = "node", fraction: float | None = None) -> Effect:
    """Return an effect: an object is removed once, even from the tool.

    Args:
        choice: Number of the object, from 1; `nearest` to the tool; or `node` for the object of the node.
        fraction: Fraction of the motion of the arm after which the effect begins, 0 to 1; None: at once.

    Raises:
        InputError: The number of the object or the fraction is out of range.
    """
    return _make_object_effect("object_removed", _remove_object, choice, fraction)


def object_moved(
    displacement: Displacement, choice: ObjectChoice = "node", fraction: float | None = None
) -> Effect:
    """Return an effect: an object is displaced once.

    Args:
        displacement: Displacement along x and y [m]; a simulated object at the destination is pushed aside.
        choice: Number of the object, from 1; `nearest` to the tool; or `node` for the object of the node.
        fraction: Fraction of the motion of the arm after which the effect begins, 0 to 1; None: at once.

    Raises:
        InputError: The number of the object or the fraction is out of range.
    """
    return _make_object_effect("object_moved", _move_object, choice, fraction, displacement)


def object_bumped(
    x: Interval, y: Interval, choice: ObjectChoice = "node", fraction: float | None = None
) -> Effect:
    """Return an effect: an object is bumped aside once, by `BUMP_DISTANCE`, to a free position.

    Args:
        x: Allowed interval of x of the new position [m].
        y: Allowed interval of y of the new position [m].
        choice: Number of the object, from 1; `nearest` to the tool; or `node` for the object of the node.
        fraction: Fraction of the motion of the arm after which the effect begins, 0 to 1; None: at once.

    Raises:
        InputError: The number of the object or the fraction is out of range.
    """
    return _make_object_effect("object_moved", _bump_object, choice, fraction, x, y)


def object_unsealable(number: int) -> Effect:
    """Return an effect: the suction cup cannot seal on the object with this number, from 1."""
    return Effect("seal_fails", interceptors={"close": _prevent_seal}, arguments=(number,))


def _make_object_effect(
    name: str, change: Callable[..., bool], choice: ObjectChoice, fraction: float | None, *arguments: Any
) -> Effect:
    """Return an effect that calls `change(occurrence, true_object, *arguments)` until it returns True."""
    if isinstance(choice, int) and choice < 1:
        raise InputError(f"the number of an object must be at least 1, not {choice}")
    return Effect(name, _change_object, arguments=(change, choice, validate_fraction(fraction), *arguments))


def _change_object(
    occurrence: Occurrence,
    change: Callable[..., bool],
    choice: ObjectChoice,
    fraction: float,
    *arguments: Any,
) -> bool:
    """Change the object if the arm has completed `fraction` of its motion; return True if it was changed."""
    context = occurrence.context
    if context.motion_progress < fraction:
        return False
    true_object = context.find_object(choice, occurrence.item)
    return true_object is not None and change(occurrence, true_object, *arguments)


def _remove_object(occurrence: Occurrence, true_object: TrueObject) -> bool:
    occurrence.emit_event(true_object)
    occurrence.context.world.remove(true_object)
    return True


def _move_object(occurrence: Occurrence, true_object: TrueObject, displacement: Displacement) -> bool:
    occurrence.emit_event(true_object)
    occurrence.context.world.move(true_object, displacement)
    return True


def _bump_object(occurrence: Occurrence, true_object: TrueObject, x: Interval, y: Interval) -> bool:
    displacement = _find_free_displacement(occurrence.context, true_object, x, y)
    return displacement is not None and _move_object(occurrence, true_object, displacement)


def _find_free_displacement(
    context: FaultContext, bumped_object: TrueObject, x: Interval, y: Interval
) -> Displacement | None:
    """Return the displacement of an object to a free position; None if no tried position is free."""
    classes = context.cell.classes
    neighbours = [neighbour for neighbour in context.world.objects if neighbour.body != bumped_object.body]

    def is_overlapping(position: Array, neighbour: TrueObject) -> bool:
        min_distance = classes[bumped_object.label].radius + classes[neighbour.label].radius
        return math.dist(position, neighbour.position[:2]) <= min_distance

    for angle in np.linspace(0.0, 2 * math.pi, BUMP_DIRECTION_COUNT, endpoint=False):
        displacement = BUMP_DISTANCE * math.cos(angle), BUMP_DISTANCE * math.sin(angle)
        position = bumped_object.position[:2] + displacement
        is_inside = x[0] <= position[0] <= x[1] and y[0] <= position[1] <= y[1]
        if is_inside and not any(is_overlapping(position, neighbour) for neighbour in neighbours):
            return displacement
    return None


def _prevent_seal(proceed: Callable[[], None], occurrence: Occurrence, number: int) -> None:
    """Close the tool, unless the tool touches the object with this number."""
    true_object = occurrence.context.find_object(number, "")
    tool_position = occurrence.context.cell.arm.tool_pose.position
    if true_object is None or math.dist(true_object.position[:2], tool_position[:2]) > MAX_TOOL_DISTANCE:
        proceed()
    else:
        occurrence.emit_event(true_object)
