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
SPHERES_PER_SEGMENT = 9
"""Number of spheres that cover the segment between two points on the axis of a part of the arm."""

ArmPart = tuple[Sequence[Array], float]
"""Points `(3,)` [m] along a part of the arm, and the radius of the spheres that enclose the part [m]."""


def compute_occlusion_mask(
    parts: Sequence[ArmPart], matrix: Array, X_WC: Pose, size: tuple[int, int]
) -> NDArray[np.bool_]:
    """Return the mask `(H, W)` of the pixels that the arm may occlude: projections of its enclosing spheres.

    `parts` are the links, the tool and the held object. `matrix` is the camera matrix `(3, 3)` [pixel], and
    `size` is the width and height of the image [pixel].
    """
    mask = np.zeros((size[1], size[0]), dtype=np.uint8)
    for points, radius in parts:
        for start, end in itertools.pairwise(points):
            for fraction in np.linspace(0.0, 1.0, SPHERES_PER_SEGMENT):
                x, y, z = X_WC.inverse().apply(start + fraction * (end - start))
                # A sphere behind the camera is invisible. The link that carries a wrist camera has a sphere
                # around the camera, which would occlude the whole image.
                if z <= radius:
                    continue
                column, row, _ = matrix @ np.array([x / z, y / z, 1.0])
                # OpenCV cannot draw circles with very large coordinates.
                if abs(column) > 4 * size[0] or abs(row) > 4 * size[1]:
                    continue
                cv2.circle(mask, (round(column), round(row)), max(1, round(matrix[0, 0] * radius / z)), 1, -1)
    return mask.astype(bool)


def compute_hull_mask(
    corners: Array, matrix: Array, X_WC: Pose, size: tuple[int, int], *, may_be_cut: bool = False
) -> NDArray[np.bool_] | None:
    """Return the mask `(H, W)` of the pixels in the convex hull of world points `(N, 3)` [m].

    Return None if the camera does not see all points; with `may_be_cut`, only if a point is behind it.
    """
    if np.any(X_WC.inverse().apply(corners)[:, 2] <= 0):
        return None
    pixels = project(matrix, X_WC, corners)
    if not may_be_cut and (np.any(pixels < 0) or np.any(pixels >= np.array(size))):
        return None
    mask = np.zeros((size[1], size[0]), dtype=np.uint8)
    cv2.fillConvexPoly(mask, cv2.convexHull(np.round(pixels).astype(np.int32)), 1)
    return mask.astype(bool)
