"""Table top and bins of the fake cell, which neither the tool tip nor its load can enter."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from executive.cell_config import CellConfig
from executive.geometry import Array
from executive.layout import bin_walls
from executive.messages import ObjectClass
from executive.motion.surroundings import PRESSED


class Collision(NamedTuple):
    """The place where a path leads farthest into an obstacle.

    Attributes:
        part: What enters it: the tool or its load.
        obstacle: The table, or the name of a bin.
        depth: How far the part is inside [m].
        place: The place in words, for the text of an error.
    """

    part: str
    obstacle: str
    depth: float
    place: str


class FakeObstacles:
    """Table top, floors and walls of a cell file as boxes that reach down without end.

    Args:
        config: The cell file.
    """

    def __init__(self, config: CellConfig) -> None:
        self._cup_radius = config.tool.cup_radius
        parts = [(name, bin, *wall) for name, bin in config.bins.items() for wall in bin_walls(bin.size)]
        middles = np.array([np.add(bin.position, middle) for _, bin, _, middle in parts]).reshape(-1, 3)
        halves = np.array([half for _, _, half, _ in parts]).reshape(-1, 3)
        # The table comes first: it is everywhere, up to height 0.
        self._names = ["the table", *(name for name, *_ in parts)]
        self._low = np.vstack([[-np.inf, -np.inf], (middles - halves)[:, :2]])
        self._high = np.vstack([[np.inf, np.inf], (middles + halves)[:, :2]])
        self._top = np.concatenate([[0.0], (middles + halves)[:, 2]])

    def find_collision(self, tips: Array, load: ObjectClass | None) -> Collision | None:
        """Return where a path of the tool tip leads into an obstacle, or None.

        Inside an obstacle the path may begin, but it may not lead deeper into it.

        Args:
            tips: Places of the tool tip `(N, 3)` [m], the first where the tool is.
            load: Class of the object in the tool, whose lower end counts then, or None.
        """
        height, radius = (load.height, load.radius + load.ring) if load else (0.0, self._cup_radius)
        x_y = tips[:, None, :2]
        beside = np.maximum(self._low - x_y, x_y - self._high)
        distance = np.linalg.norm(np.maximum(beside, 0.0), axis=2) + np.minimum(beside.max(axis=2), 0.0)
        depth = np.minimum(radius - distance, self._top - (tips[:, 2:] - height))
        excess = depth - np.maximum(depth[0], PRESSED)
        at, number = (int(index) for index in np.unravel_index(np.argmax(excess), excess.shape))
        if excess[at, number] <= 0:
            return None
        x, y, z = tips[at]
        part, place = f"the held {load.label}" if load else "the tool", f"({x:.3f}, {y:.3f}, {z:.3f}) m"
        return Collision(part, self._names[number], float(depth[at, number]), f"with the tool at {place}")
