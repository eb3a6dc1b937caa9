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
    """Deepest penetration of an obstacle along a path.

    Attributes:
        part: Name of the colliding part: the tool or its load.
        obstacle: Name of the obstacle: the table or a bin.
        depth: Depth of the part inside the obstacle [m].
        position_text: Position of the tool, as the end of an error message.
    """

    part: str
    obstacle: str
    depth: float
    position_text: str


class FakeObstacles:
    """Table top, and floors and walls of the bins, as boxes that extend downwards without limit.

    Args:
        config: The cell file.
    """

    def __init__(self, config: CellConfig) -> None:
        self._cup_radius = config.tool.cup_radius
        # The first box is the table: it has no lateral limits, and its top is at height 0.
        boxes = [("the table", np.zeros(3), (np.inf, np.inf, 0.0))]
        for name, bin in config.bins.items():
            for half_size, centre in list_bin_boxes(bin.size):
                boxes.append((name, np.add(bin.position, centre), half_size))
        self._names, centres, half_sizes = zip(*boxes, strict=True)
        self._lower_corners = np.array(centres) - half_sizes
        self._upper_corners = np.array(centres) + half_sizes

    def find_collision(self, tip_positions: Array, load: ObjectClass | None) -> Collision | None:
        """Return the deepest collision along a path of the tool tip, or None.

        A depth that does not exceed the depth at the start of the path is no collision.

        Args:
            tip_positions: Positions of the tool tip along the path `(N, 3)` [m], from the current position.
            load: Class of the held object, whose lower end is checked instead of the tool tip, or None.
        """
        height, radius = (load.height, load.radius + load.contact_radius) if load else (0.0, self._cup_radius)
        positions = tip_positions[:, None, :2]
        # Offsets beyond the nearer side along x and along y, then distances from the box; negative inside.
        offsets = np.maximum(self._lower_corners[:, :2] - positions, positions - self._upper_corners[:, :2])
        distances = np.linalg.norm(np.maximum(offsets, 0.0), axis=2) + np.minimum(offsets.max(axis=2), 0.0)
        depths = np.minimum(radius - distances, self._upper_corners[:, 2] - (tip_positions[:, 2:] - height))
        violations = depths - np.maximum(depths[0], MAX_PENETRATION)
        point, box = map(int, np.unravel_index(np.argmax(violations), violations.shape))
        if violations[point, box] <= 0:
            return None
        x, y, z = tip_positions[point]
        part = f"the held {load.label}" if load else "the tool"
        position_text = f"with the tool at ({x:.3f}, {y:.3f}, {z:.3f}) m"
        return Collision(part, self._names[box], float(depths[point, box]), position_text)
