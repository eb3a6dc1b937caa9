"""Collision check of the fake cell: tool tip or load against table top and bins."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from executive.cell.config import CellConfig
from executive.cell.layout import list_bin_boxes
from executive.cell.objects import ObjectClass
from executive.geometry import Array
from executive.motion.clearance_model import MAX_PENETRATION


class Collision(NamedTuple):
    """The deepest penetration of an obstacle along a path.

    Attributes:
        part: Name of the colliding part: the tool or its load.
        obstacle: Name of the obstacle: the table or a bin.
        depth: Depth of the part inside the obstacle [m].
        tool_position_text: Position of the tool, as the end of an error message.
    """

    part: str
    obstacle: str
    depth: float
    tool_position_text: str


class FakeObstacles:
    """Table top, and floors and walls of the bins, as boxes without a lower bound.

    Args:
        config: The cell file.
    """

    def __init__(self, config: CellConfig) -> None:
        self._cup_radius = config.tool.cup_radius
        parts = [(name, bin, *wall) for name, bin in config.bins.items() for wall in list_bin_boxes(bin.size)]
        centres = np.array([np.add(bin.position, centre) for _, bin, _, centre in parts]).reshape(-1, 3)
        half_sizes = np.array([half_size for _, _, half_size, _ in parts]).reshape(-1, 3)
        # Index 0 is the table: an infinite box with its top at height 0.
        self._names = ["the table", *(name for name, *_ in parts)]
        self._lower_corners = np.vstack([[-np.inf, -np.inf], (centres - half_sizes)[:, :2]])
        self._upper_corners = np.vstack([[np.inf, np.inf], (centres + half_sizes)[:, :2]])
        self._top_heights = np.concatenate([[0.0], (centres + half_sizes)[:, 2]])

    def find_collision(self, tips: Array, load: ObjectClass | None) -> Collision | None:
        """Return the deepest collision along a path of the tool tip, or None.

        The path may start inside an obstacle, but must not penetrate this obstacle deeper than at the start.

        Args:
            tips: Positions of the tool tip along the path `(N, 3)` [m]; the first is the current position.
            load: Class of the held object, or None. With a load, the lower end of the load is checked
                instead of the tool tip.
        """
        height, radius = (load.height, load.radius + load.ring) if load else (0.0, self._cup_radius)
        x_y = tips[:, None, :2]
        outside = np.maximum(self._lower_corners - x_y, x_y - self._upper_corners)
        distance = np.linalg.norm(np.maximum(outside, 0.0), axis=2) + np.minimum(outside.max(axis=2), 0.0)
        depth = np.minimum(radius - distance, self._top_heights - (tips[:, 2:] - height))
        excess = depth - np.maximum(depth[0], MAX_PENETRATION)
        i, obstacle = (int(index) for index in np.unravel_index(np.argmax(excess), excess.shape))
        if excess[i, obstacle] <= 0:
            return None
        x, y, z = tips[i]
        part = f"the held {load.label}" if load else "the tool"
        tool_position_text = f"with the tool at ({x:.3f}, {y:.3f}, {z:.3f}) m"
        return Collision(part, self._names[obstacle], float(depth[i, obstacle]), tool_position_text)
