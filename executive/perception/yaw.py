"""Angle of an object about the vertical axis, from its outline in an image.

A detector may give the outline. Otherwise, the outline is that of the pixels in the box that differ from the
border of the box, or that lie above the middle of the object in the depth image.

The outline is projected to the horizontal plane through the middle of the object. With z = x + iy relative to
the centroid, the moment of order n is the integral of z to the power of n over the enclosed area. For an object
that looks the same after each of n rotations, the angle of the moment is n times the angle of a corner; for
n = 2, n times the angle of the longer axis.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.cell.frame import Detection, Detections, Frame
from executive.cell.objects import ObjectClass
from executive.geometry import Array, Yaw
from executive.perception.camera_model import compute_heights
from executive.perception.evidence import is_completely_visible

Vertices = NDArray[np.complex128]
"""Vertices x + iy `(N,)` of a polygon, counterclockwise and relative to its centroid [m]."""

CROP_MARGIN = 2
"""Distance from the box to the border of the evaluated crop [pixel], because the box may be a pixel off."""
SIDE_TOLERANCE_PX = 2.0
"""Maximum additional distance between a side of an outline and the same side of the box [pixel]."""
SIDE_TOLERANCE = 0.1
"""Maximum distance between a side of an outline and the same side of the box, as a fraction of its longer side."""
AREA_RANGE = (0.4, 1.4)
"""Minimum and maximum area of an outline, as a fraction of the area of its class."""
IMAGE_OUTLINE_STD = 0.2
"""Standard deviation of an outline in an image [pixel]; its errors are independent at distances of a pixel."""
DETECTOR_OUTLINE_STD = 1.0
"""Assumed standard deviation of an outline from a detector [pixel]."""
UNEVEN_OUTLINE_STD = 0.0075
"""Standard deviation of the outline of an object with an uneven top, as a fraction of the height, because the
outline depends on the direction of view; its errors are independent at distances of the height."""
MAX_PHASE_STD = 0.5
"""Maximum standard deviation of the angle of a moment [rad]; that of a round outline is larger."""
MIN_SKEWNESS = 0.3
"""Minimum skewness of an outline along its longer axis with which its ends are distinguished."""


def measure_yaw(
    look: Detections, detection: Detection, position: Array, object_class: ObjectClass
) -> Yaw | None:
    """Return the yaw of a detected object in the world.

    The result is None for a round object, for a truncated or occluded box, and without a plausible outline. The
    yaw of an object without symmetry has the symmetry 2 if the two ends of its outline cannot be distinguished.

    Args:
        look: The detections with their frame.
        detection: Box and class of the object.
        position: Centre of the object `(3,)` [m].
        object_class: Class of the object, with a footprint.
    """
    frame = look.frame
    if not object_class.yaw_symmetry or not is_completely_visible(detection, frame, look.area):
        return None
    pixel_size = frame.compute_depth(position) / float(frame.matrix[0, 0])
    box_sides = np.array(detection.box)
    max_distance = SIDE_TOLERANCE_PX + SIDE_TOLERANCE * (box_sides[2:] - box_sides[:2]).max()
    for outline, std in _find_outlines(detection, frame, float(position[2])):
        sides = np.concatenate([outline.min(axis=0), outline.max(axis=0)])
        area = cv2.contourArea(outline.astype(np.float32)) * pixel_size**2 / object_class.outline_area
        if AREA_RANGE[0] <= area <= AREA_RANGE[1] and np.abs(sides - box_sides).max() <= max_distance:
            vertices = _project_outline(outline, frame, float(position[2]))
            return _compute_yaw(vertices, std * pixel_size, pixel_size, object_class)
    return None


def _find_outlines(detection: Detection, frame: Frame, middle: float) -> Iterator[tuple[Array, float]]:
    """Yield the outlines `(N, 2)` [pixel] of an object and their standard deviations [pixel], best first.

    `middle` is the height of the centre of the object [m].
    """
    if detection.outline:
        yield np.array(detection.outline), DETECTOR_OUTLINE_STD
    left, top, right, bottom = detection.box
    height, width = frame.visible.shape
    columns = np.arange(max(0, math.floor(left) - CROP_MARGIN), min(width, math.ceil(right) + CROP_MARGIN))
    rows = np.arange(max(0, math.floor(top) - CROP_MARGIN), min(height, math.ceil(bottom) + CROP_MARGIN))
    for mask in _find_masks(frame, columns, rows, middle):
        contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        if contours:
            contour = max(contours, key=cv2.contourArea).reshape(-1, 2)
            yield contour + (columns[0] + 0.5, rows[0] + 0.5), IMAGE_OUTLINE_STD


def _find_masks(
    frame: Frame, columns: NDArray[np.intp], rows: NDArray[np.intp], middle: float
) -> Iterator[NDArray[np.uint8]]:
    """Yield masks `(rows, columns)` of an object in a crop: by colour, by GrabCut, and by height."""
    crop = np.ascontiguousarray(frame.image[np.ix_(rows, columns)])
    border = np.concatenate([crop[0], crop[-1], crop[:, 0], crop[:, -1]])
    distances = np.linalg.norm(crop - np.median(border, axis=0), axis=2).clip(0, 255).astype(np.uint8)
    yield np.asarray(cv2.threshold(distances, 0, 1, cv2.THRESH_OTSU)[1], dtype=np.uint8)
    labels = np.zeros(crop.shape[:2], np.uint8)
    box = (CROP_MARGIN, CROP_MARGIN, len(columns) - 2 * CROP_MARGIN, len(rows) - 2 * CROP_MARGIN)
    cv2.setRNGSeed(0)  # GrabCut draws random numbers.
    cv2.grabCut(crop, labels, box, np.zeros((1, 65)), np.zeros((1, 65)), 3, cv2.GC_INIT_WITH_RECT)
    yield labels & cv2.GC_FGD
    if frame.depth is not None:
        yield (compute_heights(frame, frame.depth, columns, rows) > middle).astype(np.uint8)


def _project_outline(outline: Array, frame: Frame, height: float) -> Vertices:
    """Return the projection of an outline `(N, 2)` [pixel] to the plane at a height [m]."""
    pixels = np.column_stack([outline, np.ones(len(outline))])
    rays = pixels @ np.linalg.inv(frame.matrix).T @ frame.X_WC.rotation.T
    points = rays[:, :2] * ((height - frame.X_WC.position[2]) / rays[:, 2:])
    vertices = points[:, 0] + 1j * points[:, 1]
    following = np.roll(vertices, -1)
    doubled_areas = (vertices.conj() * following).imag  # of the triangles of the edges and the origin
    centroid = (doubled_areas * (vertices + following)).sum() / (3 * doubled_areas.sum())
    return np.asarray((vertices - centroid)[:: 1 if doubled_areas.sum() > 0 else -1])


def _compute_yaw(
    vertices: Vertices, std: float, pixel_size: float, object_class: ObjectClass
) -> Yaw | None:
    """Return the yaw of an object from its outline; None if the outline is nearly round.

    Args:
        vertices: The outline.
        std: Standard deviation of the outline [m], with errors that are independent at distances of a pixel.
        pixel_size: Side of a pixel [m].
        object_class: Class of the object.
    """
    symmetry = object_class.yaw_symmetry
    order = max(2, symmetry)
    following = np.roll(vertices, -1)
    # The integral over the triangle of an edge and the origin is a sum over products of the two vertices.
    doubled_areas = (vertices.conj() * following).imag
    sums = sum(vertices**power * following ** (order - power) for power in range(order + 1))
    moment = (doubled_areas * sums).sum() / ((order + 1) * (order + 2))
    # A displacement of an edge by d changes the moment by d times the integral of z to the power of n.
    lengths = np.abs(following - vertices)
    middles = (vertices + following) / 2
    squares = sum(weight * np.abs(z) ** (2 * order) for weight, z in ((1, vertices), (4, middles), (1, following)))
    density = std**2 * pixel_size
    if not object_class.flat_top:
        density += UNEVEN_OUTLINE_STD**2 * object_class.height**3
    phase_std = math.sqrt(density * (lengths * squares).sum() / 12) / abs(moment)
    if phase_std > MAX_PHASE_STD:
        return None
    axis = np.angle(moment) / order
    if symmetry == 1:
        skewness = _compute_skewness(vertices * np.exp(-1j * axis))
        axis += math.pi * (skewness < 0)
        symmetry = 1 if abs(skewness) >= MIN_SKEWNESS else 2
    angle = math.remainder(float(axis) - object_class.yaw_offset, math.tau / symmetry)
    return Yaw(angle, phase_std / order, symmetry)


def _compute_skewness(vertices: Vertices) -> float:
    """Return the skewness of the enclosed area along the x axis."""
    # The unit millimetre keeps single-precision moments in range.
    points = np.column_stack([vertices.real, vertices.imag]) * 1000
    moments = cv2.moments(points.astype(np.float32).reshape(-1, 1, 2))
    return float(moments["mu30"] * math.sqrt(moments["m00"]) / moments["mu20"] ** 1.5)
