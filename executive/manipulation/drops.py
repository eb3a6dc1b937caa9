"""What slips from the tool while it is carried, and where it comes down."""

from __future__ import annotations

import math

import numpy as np

from executive.cell.objects import Item
from executive.cell.protocols import Cell
from executive.geometry import GRAVITY, Array

MAX_PREDICTABLE_SPEED = 0.2
"""Tool speed up to which one can tell where something comes down [m/s]; thrown faster, it rolls."""


def record_drop(cell: Cell, item: Item) -> bool:
    """Tell whether the tool does not hold an item any more; to be asked at every tick of a carry.

    The ledger is told at once: a look taken while the arm still brakes shows the item where it lies now.
    """
    if cell.tool.holding:
        return False
    if cell.ledger.find_held_item() == item:
        velocity, height = cell.arm.tool_velocity, cell.classes[cell.ledger.get_label(item)].height
        calm = float(np.linalg.norm(velocity)) <= MAX_PREDICTABLE_SPEED
        cell.ledger.record_drop(
            item, predict_landing(cell.arm.tool_pose.position, velocity, height) if calm else None
        )
    return True


def predict_landing(place: Array, velocity: Array, height: float) -> Array:
    """Return where the middle of something comes to lie on the table `(3,)` [m], thrown and not rolling.

    Args:
        place: Of the tool that lets it go `(3,)` [m], on its upper side.
        velocity: Of the tool `(3,)` [m/s].
        height: Of the object [m].
    """
    up = float(velocity[2])
    fall = (up + math.sqrt(up**2 + 2 * GRAVITY * max(float(place[2]) - height, 0.0))) / GRAVITY
    x, y = (place + velocity * fall)[:2]
    return np.array((x, y, height / 2))
