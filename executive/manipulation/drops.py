"""Detection of items that the tool loses during a motion, and prediction of their landing."""

from __future__ import annotations

import math

import numpy as np

from executive.cell.objects import Item
from executive.cell.protocols import Cell
from executive.geometry import GRAVITY, Array

MAX_PREDICTABLE_SPEED = 0.2
"""Tool speed up to which the landing of a lost item can be predicted [m/s]; a faster item rolls."""


def record_drop(cell: Cell, item: Item) -> bool:
    """Return True if the tool has lost the carried item, and record the drop; called in every control step.

    The drop is recorded at once, because a look while the arm brakes may already show the item elsewhere.
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
    """Return the centre `(3,)` [m] of a lost object on the table after its ballistic flight, without rolling.

    Args:
        position: Position of the tool centre point at the loss `(3,)` [m].
        velocity: Velocity of the tool at the loss `(3,)` [m/s].
        height: Height of the object [m].
    """
    up = float(velocity[2])
    fall_time = (up + math.sqrt(up**2 + 2 * GRAVITY * max(float(position[2]) - height, 0.0))) / GRAVITY
    x, y = (position + velocity * fall_time)[:2]
    return np.array((x, y, height / 2))
