"""Viewpoint of a displayed picture, chosen such that arm, workspace and bins of a cell fill the image."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from executive.cell.config import CellConfig
from executive.cell.frame import Box
from executive.geometry import Array, Pose
from executive.perception.camera_model import compute_camera_matrix, compute_look_at_pose

AZIMUTH, ELEVATION = math.radians(-37), math.radians(29)
"""Direction from the cell to the camera [rad]: in front of the arm, to the right of the arm, and above."""
FIELD_OF_VIEW_DEG = 33.0
"""Vertical field of view of the camera [degree]; it is small, so that the camera is far away."""
ARM_HEIGHT = 0.8
"""Height of the arm above its base for the choice of the viewpoint [m]."""


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """Camera of a displayed picture.

    Attributes:
        matrix: Camera matrix `(3, 3)` [pixel].
        X_WC: Pose of the camera in the world.
        size: Width and height of the image [pixel].
    """

    matrix: Array
    X_WC: Pose
    size: tuple[int, int]


def compute_viewpoint(config: CellConfig, size: tuple[int, int], region: Box) -> Viewpoint:
    """Return the viewpoint from which arm, workspace and bins of a cell fill a region of the image.

    Args:
        config: The cell file.
        size: Width and height of the image [pixel].
        region: Left, top, right and bottom of the region [pixel].
    """
    matrix = compute_camera_matrix(*size, FIELD_OF_VIEW_DEG)
    direction = [
        math.cos(ELEVATION) * math.cos(AZIMUTH),
        math.cos(ELEVATION) * math.sin(AZIMUTH),
        math.sin(ELEVATION),
    ]
    R_WC = compute_look_at_pose(direction, [0, 0, 0], [0, 0, 1]).rotation
    points = _list_hull_points(config) @ R_WC
    # In camera axes, low and high are the slopes of the rays through the borders of the region. A camera at p
    # shows the point q in the region if low (q_z - p_z) <= q_x - p_x <= high (q_z - p_z), and likewise for y.
    # The largest possible p_z is chosen, then the mean of the possible p_x and p_y.
    corners = np.linalg.solve(matrix, np.array([[*region[:2], 1.0], [*region[2:], 1.0]]).T).T
    bounds = [
        (
            np.max(points[:, axis] - high * points[:, 2]),
            np.min(points[:, axis] - low * points[:, 2]),
            low,
            high,
        )
        for axis, low, high in zip((0, 1), corners[0, :2], corners[1, :2], strict=True)
    ]
    z = min((upper - lower) / (high - low) for lower, upper, low, high in bounds)
    xy = [(lower + high * z + upper + low * z) / 2 for lower, upper, low, high in bounds]
    return Viewpoint(matrix, Pose(R_WC, R_WC @ np.array([*xy, z])), size)


def _list_hull_points(config: CellConfig) -> Array:
    """Return points in the world `(N, 3)` [m] whose convex hull contains arm, workspace and bins."""
    points = [(0.0, 0.0, 0.0), (0.0, 0.0, ARM_HEIGHT)]
    points += [(x, y, 0.0) for x in config.table.x for y in config.table.y]
    for bin in config.bins.values():
        (x, y, z), (length, width, height) = bin.position, bin.size
        points += [(x + i * length / 2, y + j * width / 2, z + height) for i in (-1, 1) for j in (-1, 1)]
    return np.array(points)
