"""Obstacles of the fake cell: table top and bins, for the tool tip and its load."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from executive.cell.config import CellConfig
from executive.cell.layout import bin_walls
from executive.cell.objects import ObjectClass
from executive.geometry import Array
from executive.motion.clearance_model import MAX_PENETRATION


class Collision(NamedTuple):
    """The deepest penetration of a path into an obstacle.

    Attributes:
        part: The colliding part: the tool or its load.
        obstacle: The table, or the name of a bin.
        depth: Depth of the part inside the obstacle [m].
        place: Position of the tool in words, for the message of an error.
    """

    part: str
    obstacle: str
    depth: float
    place: str


class FakeObstacles:
    """Table top, and floors and walls of the bins, as boxes without a lower bound.

    Args:
        config: The cell file.
    """

    def __init__(self, config: CellConfig) -> None:
        self._cup_radius = config.tool.cup_radius
        parts = [(name, bin, *wall) for name, bin in config.bins.items() for wall in bin_walls(bin.size)]
        middles = np.array([np.add(bin.position, middle) for _, bin, _, middle in parts]).reshape(-1, 3)
        halves = np.array([half for _, _, half, _ in parts]).reshape(-1, 3)
        # Index 0 is the table: an infinite box with its top at height 0.
        self._names = ["the table", *(name for name, *_ in parts)]
        self._low = np.vstack([[-np.inf, -np.inf], (middles - halves)[:, :2]])
        self._high = np.vstack([[np.inf, np.inf], (middles + halves)[:, :2]])
        self._top = np.concatenate([[0.0], (middles + halves)[:, 2]])

    def find_collision(self, tips: Array, load: ObjectClass | None) -> Collision | None:
        """Return the deepest collision along a path of the tool tip, or None.

        The path may start inside an obstacle, but must not go deeper into this obstacle.

        Args:
            tips: Positions of the tool tip along the path `(N, 3)` [m]; the first is the current position.
            load: Class of the held object, or None. With a load, the lower end of the load is checked
                instead of the tool tip.
        """
        height, radius = (load.height, load.radius + load.ring) if load else (0.0, self._cup_radius)
        x_y = tips[:, None, :2]
        outside = np.maximum(self._low - x_y, x_y - self._high)
        distance = np.linalg.norm(np.maximum(outside, 0.0), axis=2) + np.minimum(outside.max(axis=2), 0.0)
        depth = np.minimum(radius - distance, self._top - (tips[:, 2:] - height))
        excess = depth - np.maximum(depth[0], MAX_PENETRATION)
        i, obstacle = (int(index) for index in np.unravel_index(np.argmax(excess), excess.shape))
        if excess[i, obstacle] <= 0:
            return None
        x, y, z = tips[i]
        part, place = f"the held {load.label}" if load else "the tool", f"({x:.3f}, {y:.3f}, {z:.3f}) m"
        return Collision(part, self._names[obstacle], float(depth[i, obstacle]), f"with the tool at {place}")
