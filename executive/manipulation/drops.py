"""Detection of items that the tool loses during a motion, and prediction of their landing position."""

from __future__ import annotations

import math

import numpy as np

from executive.cell.objects import Item
from executive.cell.protocols import Cell
from executive.geometry import GRAVITY, Array

MAX_PREDICTABLE_SPEED = 0.2
"""Maximum tool speed at which the landing position of a lost item is predictable [m/s]; faster items roll."""


def detect_and_record_drop(cell: Cell, item: Item) -> bool:
    """Return True if the tool has lost the item; the first call after the loss records the drop.

    A skill calls the function in every control step of a transport, because an image that is captured while
    the arm brakes may already show the item at its new position.
    """
    if cell.tool.holding:
        return False
    if cell.ledger.find_held_item() == item:
        velocity, height = cell.arm.tool_velocity, cell.classes[cell.ledger.get_label(item)].height
        is_slow = float(np.linalg.norm(velocity)) <= MAX_PREDICTABLE_SPEED
        cell.ledger.record_drop(
            item, predict_landing(cell.arm.tool_pose.position, velocity, height) if is_slow else None
        )
    return True


def predict_landing(position: Array, velocity: Array, height: float) -> Array:
    """Return the centre `(3,)` [m] at which a lost object lies after a ballistic fall, if it does not roll.

    Args:
        position: Position of the tool centre point at the loss `(3,)` [m].
        velocity: Velocity of the tool at the loss `(3,)` [m/s].
        height: Height of the object [m].
    """
    vertical_speed, fall_height = float(velocity[2]), max(float(position[2]) - height, 0.0)
    fall_time = (vertical_speed + math.sqrt(vertical_speed**2 + 2 * GRAVITY * fall_height)) / GRAVITY
    x, y = (position + velocity * fall_time)[:2]
    return np.array((x, y, height / 2))
