"""Masks of the pixels that the arm may occlude, and of the pixels inside a polygon in the world."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.geometry import Array, Pose
from executive.perception.camera_model import project

TOOL_SPHERE_RADIUS = 0.02
"""Radius of the spheres that enclose the tool, including tube and fittings [m]."""

ArmPart = tuple[Sequence[Array], float]
"""Points `(3,)` [m] on the axis of a part of the arm, and the radius of spheres that enclose the part [m]."""


def compute_occlusion_mask(
    parts: Sequence[ArmPart], matrix: Array, X_WC: Pose, size: tuple[int, int]
) -> NDArray[np.bool_]:
    """Return the mask `(H, W)` of the pixels that the arm may occlude: the images of spheres along its parts.

    Args:
        parts: The links, the tool and the held object.
        matrix: Camera matrix `(3, 3)` [pixel].
        X_WC: Camera pose in the world.
        size: Width and height of the image [pixel].
    """
    mask = np.zeros((size[1], size[0]), dtype=np.uint8)
    for points, radius in parts:
        for start, end in itertools.pairwise(points):
            for fraction in np.linspace(0.0, 1.0, 9):
                x, y, z = X_WC.inverse().apply(start + fraction * (end - start))
                # Spheres behind or around the camera are skipped: the sphere around the link on which a
                # wrist camera is mounted would occlude the whole image.
                if z <= radius:
                    continue
                column, row, _ = matrix @ np.array([x / z, y / z, 1.0])
                if abs(column) > 4 * size[0] or abs(row) > 4 * size[1]:
                    continue
                cv2.circle(mask, (round(column), round(row)), max(1, round(matrix[0, 0] * radius / z)), 1, -1)
    return mask.astype(bool)


def compute_hull_mask(
    corners: Array, matrix: Array, X_WC: Pose, size: tuple[int, int]
) -> NDArray[np.bool_] | None:
    """Return the mask `(H, W)` of the pixels in the convex hull of the images of world points `(N, 3)` [m].

    None if the image of any point is outside the image.
    """
    if np.any(X_WC.inverse().apply(corners)[:, 2] <= 0):
        return None
    pixels = project(matrix, X_WC, corners)
    if np.any(pixels < 0) or np.any(pixels >= np.array(size)):
        return None
    mask = np.zeros((size[1], size[0]), dtype=np.uint8)
    cv2.fillConvexPoly(mask, cv2.convexHull(np.round(pixels).astype(np.int32)), 1)
    return mask.astype(bool)
