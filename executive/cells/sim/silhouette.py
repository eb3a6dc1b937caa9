"""Silhouette of an object in an image, occluded parts included: box, area and visible share."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.cell.frame import Box
from executive.cells.sim.models import Mesh
from executive.geometry import Array

FINE = 4
"""Subdivisions of a pixel along each axis for the rasterization of a silhouette."""


def outline_box(pixels: Array) -> Box:
    """Return the box around projected vertices `(N, 2)` [pixel]."""
    (left, top), (right, bottom) = pixels.min(axis=0), pixels.max(axis=0)
    return float(left), float(top), float(right), float(bottom)


def outline_area(mesh: Mesh, pixels: Array) -> float:
    """Return the area [pixel²] of the silhouette of a mesh whose projected vertices are `pixels` `(N, 2)`."""
    if mesh.convex:
        return float(cv2.contourArea(cv2.convexHull(pixels.astype(np.float32))))
    corner = np.floor(pixels.min(axis=0))
    size = np.ceil((pixels.max(axis=0) - corner + 1) * FINE).astype(int)
    canvas = np.zeros((size[1], size[0]), np.uint8)
    triangles = ((pixels - corner) * FINE)[mesh.triangles]
    for triangle in _select_one_winding(triangles).round().astype(np.int32):
        cv2.fillConvexPoly(canvas, triangle, 1)
    return float(canvas.sum()) / FINE**2


def visible_share(mesh: Mesh, pixels: Array, seen: NDArray[np.bool_]) -> float:
    """Return the share (0 to 1) of a silhouette that is visible by the mask `seen` `(H, W)`."""
    return min(1.0, float(seen.sum()) / max(outline_area(mesh, pixels), 1.0))


def _select_one_winding(triangles: Array) -> Array:
    """Return the projected triangles `(M, 3, 2)` of one winding: the silhouette of a closed mesh."""
    (ax, ay), (bx, by) = (triangles[:, 1] - triangles[:, 0]).T, (triangles[:, 2] - triangles[:, 0]).T
    return np.asarray(triangles[ax * by - ay * bx > 0])
