"""Detection of the drop of a carried item, its record in the ledger, and the place where the item lands."""

from __future__ import annotations

import math

import numpy as np

from executive.cell.objects import Item
from executive.cell.protocols import Cell
from executive.geometry import GRAVITY, Array
from executive.skill import Skill

MAX_PREDICTABLE_SPEED = 0.2
"""Maximum tool speed at which the landing position of an item is predictable [m/s]; faster items roll."""


def fail_if_dropped(skill: Skill, cell: Cell, item: Item, place: str) -> None:
    """If the tool has lost `item`, record the drop, open the tool, and fail.

    `place` describes the place of the drop in the error message.

    Raises:
        SkillFailed: The tool lost the item; the reason is `dropped`.
    """
    if detect_and_record_drop(cell, item):
        x, y, z = cell.arm.tool_pose.position
        cell.tool.open()
        noun = cell.tool_model.noun
        message = f"the {noun} on {item} broke {place}, near ({x:.2f}, {y:.2f}, {z:.2f}) m"
        raise skill.failure("dropped", message)


def detect_and_record_drop(cell: Cell, item: Item) -> bool:
    """Return True if the tool has dropped the item; the first call after the drop updates the ledger.

    A transport calls this function in every control step, so that the ledger knows the drop before a camera
    shows the item at another place.
    """
    if cell.tool.holding:
        return False
    if cell.ledger.find_held_item() == item:
        velocity = cell.arm.tool_velocity
        is_predictable = float(np.linalg.norm(velocity)) <= MAX_PREDICTABLE_SPEED
        landing = None
        if is_predictable:
            object_class = cell.classes[cell.ledger.get_label(item)]
            # Each read of the tool pose is written to the journal, so it is read only if it is needed.
            underside = cell.arm.tool_pose.position.copy()
            underside[2] -= cell.tool_model.get_hold_height(object_class)
            landing = predict_landing(underside, velocity, object_class.height)
        cell.ledger.record_drop(item, landing)
    return True


def predict_landing(position: Array, velocity: Array, height: float) -> Array:
    """Return the centre of a dropped object `(3,)` [m] after a ballistic fall without rolling.

    Args:
        position: Centre of the underside of the object at the drop `(3,)` [m].
        velocity: Velocity of the tool at the drop `(3,)` [m/s].
        height: Height of the object [m].
    """
    vertical_speed = float(velocity[2])
    fall_height = max(float(position[2]), 0.0)
    # Ballistic fall: positive solution t of fall_height + vertical_speed * t - GRAVITY / 2 * t**2 = 0.
    fall_time = (vertical_speed + math.sqrt(vertical_speed**2 + 2 * GRAVITY * fall_height)) / GRAVITY
    x, y = (position + velocity * fall_time)[:2]
    return np.array((x, y, height / 2))
