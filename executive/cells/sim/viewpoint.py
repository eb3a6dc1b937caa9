"""Virtual camera of rendered images in which arm, workspace and bins of a cell fill a region."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from executive.cell.config import CellConfig
from executive.cell.frame import Box
from executive.geometry import Array, Pose
from executive.perception.camera_model import compute_camera_matrix, compute_look_at_pose

CAMERA_AZIMUTH, CAMERA_ELEVATION = math.radians(-37), math.radians(29)
"""Direction from the cell to the camera [rad]: in front of the arm, to the right, and above."""
FIELD_OF_VIEW_DEG = 33.0
"""Vertical field of view of the camera [degree]; a small value reduces perspective distortion."""
ARM_HEIGHT = 0.8
"""Height of the arm above its base for the choice of the viewpoint [m]."""


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """Virtual camera of a rendered image.

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
    x, y = (math.cos(CAMERA_ELEVATION) * function(CAMERA_AZIMUTH) for function in (math.cos, math.sin))
    R_WC = compute_look_at_pose([x, y, math.sin(CAMERA_ELEVATION)], [0, 0, 0], [0, 0, 1]).rotation
    points = _list_hull_points(config) @ R_WC
    # In camera axes, low and high are the slopes of the rays through the corners of the region. A camera at p
    # shows a point q in the region if low (q_z - p_z) <= q_x - p_x <= high (q_z - p_z), and likewise for y.
    # The largest possible p_z is chosen, then the mean of the possible p_x and p_y.
    corners = np.array([[*region[:2], 1.0], [*region[2:], 1.0]]).T
    low, high = np.linalg.solve(matrix, corners).T[:, :2]
    lower = np.max(points[:, :2] - high * points[:, 2:], axis=0)
    upper = np.min(points[:, :2] - low * points[:, 2:], axis=0)
    z = np.min((upper - lower) / (high - low))
    xy = (lower + high * z + upper + low * z) / 2
    return Viewpoint(matrix, Pose(R_WC, R_WC @ np.array([*xy, z])), size)


def _list_hull_points(config: CellConfig) -> Array:
    """Return points in the world `(N, 3)` [m] whose convex hull contains arm, workspace and bins."""
    points = [(0.0, 0.0, 0.0), (0.0, 0.0, ARM_HEIGHT)]
    points += itertools.product(config.table.x, config.table.y, (0.0,))
    for bin in config.bins.values():
        (x, y, z), (length, width, height) = bin.position, bin.size
        xs, ys = (x - length / 2, x + length / 2), (y - width / 2, y + width / 2)
        points += itertools.product(xs, ys, (z + height,))
    return np.array(points)
