"""Viewpoint from which arm, workspace and bins of a cell fill an image."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from executive.cell.config import CellConfig
from executive.cell.frame import Box
from executive.geometry import Array, Pose
from executive.perception.camera_model import compute_camera_matrix, compute_look_at_pose

AZIMUTH, ELEVATION = math.radians(-37), math.radians(29)
"""Direction from the cell to the camera [rad]: in front of the arm, to its right, and above."""
FIELD_OF_VIEW_DEG = 33.0
"""Vertical field of view [degree]: narrow, for a distant camera."""
ARM_HEIGHT = 0.8
"""Largest height of the arm above its base [m]."""


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """A camera for display; no decision depends on its images.

    Attributes:
        matrix: Camera matrix `(3, 3)` [pixel].
        X_WC: Pose of the camera in the world.
        size: Width and height of the image [pixel].
    """

    matrix: Array
    X_WC: Pose
    size: tuple[int, int]


def overview(config: CellConfig, size: tuple[int, int], part: Box) -> Viewpoint:
    """Return the viewpoint from which arm, workspace and bins of a cell fill a part of the image.

    Args:
        config: The cell file.
        size: Width and height of the image [pixel].
        part: Left, top, right and bottom of the part of the image to fill [pixel].
    """
    matrix = compute_camera_matrix(*size, FIELD_OF_VIEW_DEG)
    away = [
        math.cos(ELEVATION) * math.cos(AZIMUTH),
        math.cos(ELEVATION) * math.sin(AZIMUTH),
        math.sin(ELEVATION),
    ]
    R_WC = compute_look_at_pose(away, [0, 0, 0], [0, 0, 1]).rotation
    points = _outline(config) @ R_WC
    # A camera at p sees a point q between the slopes low and high if
    # low (q_z - p_z) <= q_x - p_x <= high (q_z - p_z). Choose the nearest p_z, then the middle of p_x.
    corners = np.linalg.solve(matrix, np.array([[*part[:2], 1.0], [*part[2:], 1.0]]).T).T
    spans = [
        (
            np.max(points[:, axis] - high * points[:, 2]),
            np.min(points[:, axis] - low * points[:, 2]),
            low,
            high,
        )
        for axis, low, high in zip((0, 1), corners[0, :2], corners[1, :2], strict=True)
    ]
    z = min((last - first) / (high - low) for first, last, low, high in spans)
    xy = [(first + high * z + last + low * z) / 2 for first, last, low, high in spans]
    return Viewpoint(matrix, Pose(R_WC, R_WC @ np.array([*xy, z])), size)


def _outline(config: CellConfig) -> Array:
    """Return points `(N, 3)` [m] that enclose arm, workspace and bins."""
    points = [(0.0, 0.0, 0.0), (0.0, 0.0, ARM_HEIGHT)]
    points += [(x, y, 0.0) for x in config.table.x for y in config.table.y]
    for bin in config.bins.values():
        (x, y, z), (length, width, height) = bin.position, bin.size
        points += [(x + i * length / 2, y + j * width / 2, z + height) for i in (-1, 1) for j in (-1, 1)]
    return np.array(points)
