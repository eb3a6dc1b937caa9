"""Where things go in a cell: drop slots, and the height at which loads travel."""

from __future__ import annotations

import numpy as np

from executive.cell_config import BinConfig, CellConfig
from executive.messages import Bin


def as_bin(name: str, config: BinConfig) -> Bin:
    """Return the bin of a cell file with its drop slots spread evenly over the floor."""
    position, size = np.array(config.position), np.array(config.size)
    columns, rows = config.slots
    x = position[0] + size[0] * ((np.arange(columns) + 0.5) / columns - 0.5)
    y = position[1] + size[1] * ((np.arange(rows) + 0.5) / rows - 0.5)
    slots = np.array([[column, row] for column in x for row in y])
    return Bin(name, position, size, slots)


def travel_height(config: CellConfig) -> float:
    """Return the tool height [m] at which the highest load clears the highest wall and object."""
    tallest = max(kind.height for kind in config.objects.values())
    wall = max(bin.position[2] + bin.size[2] for bin in config.bins.values())
    return max(wall, tallest) + tallest + config.motion.clearance
