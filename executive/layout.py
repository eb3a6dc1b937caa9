"""What a cell file means in space: bins with their drop slots, classes of objects, the height of travel."""

from __future__ import annotations

import numpy as np

from executive.cell_config import BinConfig, CellConfig, ObjectConfig
from executive.messages import Bin, ObjectClass

TOOL_RADIUS = 0.012
"""Radius of the tool's body [m]."""
NECK_LENGTH = 0.015
"""Length of the thin part at the tool's end, as wide as the cup [m]."""


def as_bin(name: str, config: BinConfig) -> Bin:
    """Return the bin of a cell file with its drop slots spread evenly over the floor."""
    position, size = np.array(config.position), np.array(config.size)
    columns, rows = config.slots
    x = position[0] + size[0] * ((np.arange(columns) + 0.5) / columns - 0.5)
    y = position[1] + size[1] * ((np.arange(rows) + 0.5) / rows - 0.5)
    slots = np.array([[column, row] for column in x for row in y])
    return Bin(name, position, size, slots)


def as_class(label: str, config: ObjectConfig) -> ObjectClass:
    """Return what skills know of a class of objects of a cell file; its mass is left at the default."""
    return ObjectClass(label, config.height, config.radius, config.ring)


def travel_height(config: CellConfig) -> float:
    """Return the tool height [m] at which the highest load clears the highest wall and the highest pile."""
    tallest = max(kind.height for kind in config.objects.values())
    wall = max(bin.position[2] + bin.size[2] for bin in config.bins.values())
    return max(wall, pile_height(config)) + tallest + config.motion.clearance


def pile_height(config: CellConfig) -> float:
    """Return how high [m] things on the table may be: the tallest object, or two where some are stacked."""
    tallest = max(kind.height for kind in config.objects.values())
    return 2 * tallest if config.table.stacked else tallest
