"""Silhouette of an object in an image, including occluded parts: box and area."""

from __future__ import annotations

import cv2
import numpy as np

from executive.cell.frame import Box
from executive.cells.sim.models import Mesh
from executive.geometry import Array

SUBPIXEL_COUNT = 4
"""Number of subpixels of a pixel along each axis in the rasterization of a silhouette."""


def compute_bounding_box(pixels: Array) -> Box:
    """Return the box around projected vertices `(N, 2)` [pixel]."""
    (left, top), (right, bottom) = pixels.min(axis=0), pixels.max(axis=0)
    return float(left), float(top), float(right), float(bottom)


def compute_silhouette_area(mesh: Mesh, pixels: Array) -> float:
    """Return the area [pixel²] of the silhouette of a mesh whose projected vertices are `pixels` `(N, 2)`."""
    if mesh.is_convex:
        return float(cv2.contourArea(cv2.convexHull(pixels.astype(np.float32))))
    corner = np.floor(pixels.min(axis=0))
    size = np.ceil((pixels.max(axis=0) - corner + 1) * SUBPIXEL_COUNT).astype(int)
    mask = np.zeros((size[1], size[0]), np.uint8)
    triangles = ((pixels - corner) * SUBPIXEL_COUNT)[mesh.triangles]
    (ax, ay), (bx, by) = (triangles[:, 1] - triangles[:, 0]).T, (triangles[:, 2] - triangles[:, 0]).T
    # The triangles on the side of the camera, whose corners are clockwise, cover the whole silhouette.
    for triangle in triangles[ax * by - ay * bx > 0].round().astype(np.int32):
        cv2.fillConvexPoly(mask, triangle, 1)
    return float(mask.sum()) / SUBPIXEL_COUNT**2
