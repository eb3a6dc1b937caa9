"""Angle of an object about the vertical axis, from its outline in an image.

A detector may give the outline. Otherwise, the outline is that of the pixels in the box that differ from the
border of the box or, for an object on another one, that are higher than the lower object in the depth image.

The outline is projected to the horizontal plane through the middle of the object. With z = x + iy relative
to the centroid, the moment of order n is the integral of z to the power of n over the enclosed area. For an
object that looks the same after each of n equal rotations, its angle is n times the angle of a corner; for
n = 2, twice the angle of the longer axis.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.cell.frame import Detection, Detections, Frame
from executive.cell.objects import ObjectClass
from executive.geometry import Array, Yaw
from executive.perception.camera_model import compute_heights
from executive.perception.evidence import MIN_OUTLINE_STDS, TOP_TOLERANCE, is_completely_visible

Vertices = NDArray[np.complex128]
"""Vertices x + iy `(N,)` of a polygon, counterclockwise and relative to its centroid [m]."""

CROP_MARGIN = 2
"""Distance from the box to the border of the evaluated crop [pixel], because the box may be a pixel off."""
SIDE_TOLERANCE_PX = 2.0
"""Maximum additional distance between a side of an outline and the same side of the box [pixel]."""
SIDE_TOLERANCE = 0.1
"""Maximum distance between a side of an outline and the same side of the box, relative to its longer side."""
MIN_AREA_FRACTION = 0.4
"""Minimum area of the convex hull of an outline, as a fraction of the area of its class."""
MAX_AREA_FACTOR = 1.3
"""Maximum area of the convex hull of an outline, as a multiple of the largest area of a prism over the
outline of its class."""
COLOUR_OUTLINE_STD = 0.25
"""Standard deviation of an outline by colour [pixel]; its errors are independent at distances of a pixel.

With this value, 95 % of the yaws of cubes in rendered images were within two standard deviations
(tests/benchmarks/yaw.py). Images of real cameras were not measured.
"""
DEPTH_OUTLINE_STD = 1.0
"""Standard deviation of an outline in the depth image of a D435, which has gaps at edges [pixel]."""
DETECTOR_OUTLINE_STD = 1.0
"""Assumed standard deviation of an outline from a detector [pixel]."""
FLAT_OBLIQUE_FRACTION = 0.01
"""Standard deviation of the outline of an object with a flat top because of an oblique view, as a fraction of
the horizontal distance between top and base in the image; its errors are independent at the distance of the
height.

The value was fitted to rendered images of cubes with up to 23 degrees between view and vertical axis.
"""
UNEVEN_OBLIQUE_FRACTION = 0.07
"""The same for an object with an uneven top, which is no prism, fitted to images of ducks."""
MAX_PHASE_STD = 0.5
"""Maximum standard deviation of the angle of a moment [rad]; that of a round outline is larger."""
MIN_SKEWNESS = 0.05
"""Minimum skewness of an outline with which its ends are distinguished, or the sides of a bent object.

In rendered images, the skewnesses of 51 bolts were 0.17 to 0.25, those of 83 ducks at most 0.15. From 0.04
on, all had the same sign; below, a third of the ducks had the other sign.
"""


def measure_yaw(
    look: Detections, detection: Detection, position: Array, object_class: ObjectClass
) -> tuple[Yaw, Array] | None:
    """Return the yaw of a detected object in the world, and the middle of its outline `(3,)` [m].

    The middle is that of the rectangle around the outline with sides along the axes of the object. The middle
    of the box is beside it if an object without symmetry lies obliquely in the image.

    The result is None for a round object, for a truncated or occluded box, and without a plausible outline.
    The yaw of an object without symmetry has the symmetry 2 if its two ends cannot be distinguished.

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
    ray = position - frame.X_WC.position
    top_shift = object_class.height * float(np.linalg.norm(ray[:2]) / abs(ray[2]))
    max_area = object_class.outline_area + 2 * object_class.radius * top_shift
    oblique_fraction = FLAT_OBLIQUE_FRACTION if object_class.flat_top else UNEVEN_OBLIQUE_FRACTION
    box_sides = np.array(detection.box)
    max_distance = SIDE_TOLERANCE_PX + SIDE_TOLERANCE * (box_sides[2:] - box_sides[:2]).max()
    for outline, std in _find_outlines(detection, frame, position, object_class):
        sides = np.concatenate([outline.min(axis=0), outline.max(axis=0)])
        # Scissors cover a quarter of their footprint, but their convex hull more than half of it.
        area = cv2.contourArea(cv2.convexHull(outline.astype(np.float32))) * pixel_size**2
        has_area = MIN_AREA_FRACTION * object_class.outline_area <= area <= MAX_AREA_FACTOR * max_area
        if has_area and np.abs(sides - box_sides).max() <= max_distance:
            density = (std * pixel_size) ** 2 * pixel_size
            density += (oblique_fraction * top_shift) ** 2 * object_class.height
            vertices, centroid = _project_outline(outline, frame, float(position[2]))
            yaw = _compute_yaw(vertices, density, object_class)
            if yaw is None:
                return None
            axis = np.exp(1j * yaw.angle)
            turned = vertices / axis
            extremes = [(each.min() + each.max()) / 2 for each in (turned.real, turned.imag)]
            middle = centroid + (extremes[0] + 1j * extremes[1]) * axis
            return yaw, np.array([middle.real, middle.imag, position[2]])
    return None


def _find_outlines(
    detection: Detection, frame: Frame, position: Array, object_class: ObjectClass
) -> Iterator[tuple[Array, float]]:
    """Yield the outlines `(N, 2)` [pixel] of an object and their standard deviations [pixel], best first."""
    if detection.outline:
        yield np.array(detection.outline), DETECTOR_OUTLINE_STD
    left, top, right, bottom = detection.box
    height, width = frame.visible.shape
    columns = np.arange(max(0, math.floor(left) - CROP_MARGIN), min(width, math.ceil(right) + CROP_MARGIN))
    rows = np.arange(max(0, math.floor(top) - CROP_MARGIN), min(height, math.ceil(bottom) + CROP_MARGIN))
    for mask, std in _find_masks(frame, columns, rows, float(position[2]), object_class.height):
        contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        if contours:
            contour = max(contours, key=cv2.contourArea).reshape(-1, 2)
            yield contour + np.array([columns[0] + 0.5, rows[0] + 0.5]), std


def _find_masks(
    frame: Frame, columns: NDArray[np.intp], rows: NDArray[np.intp], middle: float, height: float
) -> Iterator[tuple[NDArray[np.uint8], float]]:
    """Yield masks `(rows, columns)` of an object in a crop, and the standard deviations of outlines [pixel].

    Only the depth image distinguishes an object from another one on which it stands. `middle` is the height
    of the centre of the object above the table, and `height` is the height of the object itself [m].
    """
    if middle - height / 2 <= TOP_TOLERANCE:
        crop = np.ascontiguousarray(frame.image[np.ix_(rows, columns)])
        for mask in _find_masks_by_colour(crop):
            yield mask, COLOUR_OUTLINE_STD
    if frame.depth is not None:
        heights = compute_heights(frame, frame.depth, columns, rows)
        # The means of known neighbours fill the gaps at edges.
        sums = cv2.blur(np.nan_to_num(heights), (3, 3))
        known_fractions = cv2.blur(np.isfinite(heights).astype(float), (3, 3))
        is_object = sums > (middle - height / 4) * known_fractions
        yield is_object.astype(np.uint8), DEPTH_OUTLINE_STD


def _find_masks_by_colour(crop: NDArray[np.uint8]) -> Iterator[NDArray[np.uint8]]:
    """Yield masks `(H, W)` of the object in a crop `(H, W, 3)` that contrast with the border of the crop.

    The first one contains the pixels that differ from the border. GrabCut also finds objects of two colours.
    """
    border = np.concatenate([crop[0], crop[-1], crop[:, 0], crop[:, -1]])
    background = np.median(border, axis=0)
    min_distance = MIN_OUTLINE_STDS * float(np.median(np.linalg.norm(border - background, axis=1)))
    distances = np.linalg.norm(crop - background, axis=2).clip(0, 255).astype(np.uint8)
    for find_mask in (partial(_apply_threshold, distances), partial(_apply_grab_cut, crop)):
        mask = find_mask()
        if mask.any() and np.median(distances[mask > 0]) >= min_distance:
            yield mask


def _apply_threshold(distances: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.asarray(cv2.threshold(distances, 0, 1, cv2.THRESH_OTSU)[1], np.uint8)


def _apply_grab_cut(crop: NDArray[np.uint8]) -> NDArray[np.uint8]:
    labels = np.zeros(crop.shape[:2], np.uint8)
    height, width = np.maximum(np.subtract(crop.shape[:2], 2 * CROP_MARGIN), 1).tolist()
    box = (CROP_MARGIN, CROP_MARGIN, width, height)
    cv2.setRNGSeed(0)  # GrabCut draws random numbers.
    cv2.grabCut(crop, labels, box, np.zeros((1, 65)), np.zeros((1, 65)), 3, cv2.GC_INIT_WITH_RECT)
    return (labels & cv2.GC_FGD).astype(np.uint8)


def _project_outline(outline: Array, frame: Frame, height: float) -> tuple[Vertices, complex]:
    """Return the projection of an outline `(N, 2)` [pixel] to the plane at a height, and its centroid [m]."""
    pixels = np.column_stack([outline, np.ones(len(outline))])
    rays = pixels @ np.linalg.inv(frame.matrix).T @ frame.X_WC.rotation.T
    points = rays[:, :2] * ((height - frame.X_WC.position[2]) / rays[:, 2:])
    vertices = points[:, 0] + 1j * points[:, 1]
    following = np.roll(vertices, -1)
    doubled_areas = (vertices.conj() * following).imag  # of the triangles of the edges and the origin
    centroid = (doubled_areas * (vertices + following)).sum() / (3 * doubled_areas.sum())
    vertices = vertices - centroid
    place = complex(centroid + frame.X_WC.position[0] + 1j * frame.X_WC.position[1])
    return vertices if doubled_areas.sum() > 0 else vertices[::-1], place


def _compute_yaw(vertices: Vertices, density: float, object_class: ObjectClass) -> Yaw | None:
    """Return the yaw of an object from its outline; None if the outline is nearly round.

    `density` is the variance of the outline times the distance at which its errors are independent [m³].
    """
    symmetry = object_class.yaw_symmetry
    order = max(2, symmetry)
    following = np.roll(vertices, -1)
    # The integral over the triangle of an edge and the origin is a sum over products of the two vertices.
    doubled_areas = (vertices.conj() * following).imag
    sums = sum(vertices**power * following ** (order - power) for power in range(order + 1))
    moment = (doubled_areas * sums).sum() / ((order + 1) * (order + 2))
    # A displacement d of a short piece of the outline with length l changes the moment by d * l * z^n.
    ends = np.abs(vertices) ** (2 * order) + np.abs(following) ** (2 * order)
    middles = np.abs((vertices + following) / 2) ** (2 * order)
    squares = np.abs(following - vertices) * (ends + 4 * middles) / 6  # Simpson's rule along each edge
    moment_std = math.sqrt(density * squares.sum() / 2)
    if moment_std >= MAX_PHASE_STD * abs(moment):
        return None
    axis = np.angle(moment) / order
    if symmetry == 1:
        skewness = choose_skewness(vertices * np.exp(-1j * axis))
        if skewness < 0:
            axis += math.pi
        symmetry = 1 if skewness else 2
    angle = math.remainder(float(axis) - object_class.yaw_offset, math.tau / symmetry)
    return Yaw(angle, moment_std / float(abs(moment)) / order, symmetry)


def choose_skewness(vertices: Vertices) -> float:
    """Return the skewness of the enclosed area by which a half turn is recognized; 0 if there is none.

    It is the larger one of the skewnesses along the x axis, the longer one, and along the y axis. An object
    with narrower ends has its skewness along x, a bent one along y.
    """
    # The unit millimetre keeps single-precision moments in range.
    points = np.column_stack([vertices.real, vertices.imag]) * 1000
    moments = cv2.moments(points.astype(np.float32).reshape(-1, 1, 2))
    pairs = ((moments["mu30"], moments["mu20"]), (moments["mu03"], moments["mu02"]))
    skewness = max((cube * math.sqrt(moments["m00"]) / variance**1.5 for cube, variance in pairs), key=abs)
    return float(skewness) if abs(skewness) >= MIN_SKEWNESS else 0.0
