"""Which pixels of a camera the arm hides, from its kinematics alone."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.geometry import Array, Pose

TOOL_SHADOW = 0.02
"""Radius of the spheres that stand for the tool: its tube with fittings [m]."""


Bone = tuple[Sequence[Array], float]
"""Points `(3,)` [m] along a part of the arm, and the radius of the spheres that stand for it [m]."""


def find_hidden_pixels(
    bones: Sequence[Bone], matrix: Array, X_WC: Pose, size: tuple[int, int]
) -> NDArray[np.bool_]:
    """Return which pixels `(H, W)` the arm may cover, as the shadow of spheres along its bones.

    Args:
        bones: The links, the tool, and what it holds.
        matrix: Camera matrix `(3, 3)` [pixel].
        X_WC: Camera pose.
        size: Image width and height [pixel].
    """
    mask = np.zeros((size[1], size[0]), dtype=np.uint8)
    for points, radius in bones:
        for start, end in itertools.pairwise(points):
            for share in np.linspace(0.0, 1.0, 9):
                x, y, z = X_WC.inverse().apply(start + share * (end - start))
                # What is beside or behind the lens, or closer than its own size, covers nothing we
                # look at: the wrist camera is bolted to the very link it would be said to hide.
                if z <= radius:
                    continue
                column, row, _ = matrix @ np.array([x / z, y / z, 1.0])
                if abs(column) > 4 * size[0] or abs(row) > 4 * size[1]:
                    continue
                cv2.circle(mask, (round(column), round(row)), max(1, round(matrix[0, 0] * radius / z)), 1, -1)
    return mask.astype(bool)


def find_outline_pixels(
    corners: Array, matrix: Array, X_WC: Pose, size: tuple[int, int]
) -> NDArray[np.bool_] | None:
    """Return the pixels `(H, W)` inside the convex outline of world points `(N, 3)` [m].

    None where any of the points lies outside the image: the outline is not wholly in view.
    """
    in_camera = X_WC.inverse().apply(corners)
    if np.any(in_camera[:, 2] <= 0):
        return None
    projected = in_camera @ matrix.T
    pixels = projected[:, :2] / projected[:, 2:]
    if np.any(pixels < 0) or np.any(pixels >= np.array(size)):
        return None
    mask = np.zeros((size[1], size[0]), dtype=np.uint8)
    cv2.fillConvexPoly(mask, cv2.convexHull(np.round(pixels).astype(np.int32)), 1)
    return mask.astype(bool)
