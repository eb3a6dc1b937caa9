"""Evidence about a detected class: weight, height in the depth image, size of the box.

An object may stand on the table or, in a cell with stacks, on one object of any class. In the functions,
`label` is the assumed class of the object, and `classes` contains the classes of the cell by label.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.cell.frame import Box, Detection, Detections, Frame
from executive.cell.objects import ObjectClass
from executive.errors import NoDepth
from executive.geometry import GRAVITY, Array, rotate_about_z
from executive.perception.camera_model import measure_top_height, project

TOP_TOLERANCE = 0.012
"""Maximum difference between the height of an object's top in the depth image and an expected height [m].

In 480 scenes of the cell `depth` (60 crowded, 60 with unknown objects), the tops of 1894 correctly detected
objects had a mean error of 2.1 mm and a maximum error of 10.1 mm. The tops of 20 of 26 unknown objects
contradicted the detected class.
"""
MAX_WEIGHT_OF_UNDECLARED_CLASS = 10.0
"""Maximum weight of an object of no declared class [N], of the order of the holding force of tools."""
REFERENCE_DISTANCE = 1.2
"""Maximum distance from the camera at which `TOP_TOLERANCE` applies [m].

At larger distances, the tolerance grows with the squared distance, like the noise of a stereo camera. The
tolerance at 1.8 m is 27 mm; 160 tops had errors of at most 18.3 mm there.
"""
SIZE_TOLERANCE = 0.15
"""Maximum relative difference between the size of a box and the sizes that its class allows."""
SIZE_TOLERANCE_PX = 2.0
"""Maximum additional difference between the size of a box and the sizes that its class allows [pixel]."""
FOOTPRINT_YAWS = np.radians([start + step for start in (0, 5, 10) for step in range(0, 180, 15)])
"""Yaws at which the outline of a class is compared with an object `(36,)` [rad]; one that fits is early."""
FOOTPRINT_ROTATIONS = np.array([rotate_about_z(-yaw) for yaw in FOOTPRINT_YAWS])
"""Matrices `(36, 3, 3)` that turn row vectors by these yaws."""
MIN_SIDE_FRACTION = 0.85
"""Minimum side of a box, as a fraction of the same side of the image of the footprint of its class."""
MAX_SIDE_FACTOR = 1.07
"""Maximum side of a box, as a multiple of the same side of the image of a prism over the footprint.

In as-run scenes, the shipped detectors made 5,697 correct, completely visible detections: overhead 1,152,
wrist 1,154, depth 1,082, overhead_large 1,186, fasteners 1,123; none contradicted its class. The same limits
reject the projections of bricks as cubes, with random yaws and box errors of 0.5 pixel: 1,454 of 1,465 with
80 x 50 x 50 mm, all with 90 x 50 x 50 mm; as spheres and ducks, all of both. The limits were chosen on these
detections; boxes of a detector on real bricks were not measured.
"""
SIDE_TOLERANCE_PX = 1.5
"""Maximum additional difference between a side of a box and the sides that the footprint allows [pixel]."""
MIN_OUTLINE_CONTRAST = 20.0
"""Minimum deviation of a pixel of an object from the table around it [grey level]."""
MIN_OUTLINE_STDS = 4.0
"""Minimum deviation of a pixel of an object from the table around it, in standard deviations of the table."""
MIN_SHOWN_PART = 0.7
"""Minimum area of an outline that is compared, as a fraction of that of the class, and of the visible part of
the class, as a fraction of the whole."""
MIN_OVERLAP = 0.85
"""Minimum common part of the outlines of an object and its class, as a fraction of their union.

In declared runs of sort_overhead, sort_wrist and sort_large, 360 of 362 detections of cubes had at least
0.92, the others were beside the moving arm. Bricks of 65 x 50 mm had 0.77 to 0.82, and of 58 x 50 mm 0.86 to
0.90.
"""
MIN_BORDER_DISTANCE = 2.0
"""Minimum distance of a completely visible box from the border of the searched region [pixel]."""


def describe_unknown_labels(counts: Mapping[str, int]) -> str:
    """Return a text with the number of boxes of each unknown label: `unknown: rubber-duck ×2`; "" if none."""
    labels = ", ".join(f"{label} ×{count}" for label, count in counts.items())  # noqa: RUF001
    return f"unknown: {labels}" if labels else ""


def compute_weight_log_ratios(
    weight: float, std: float, classes: Mapping[str, ObjectClass]
) -> dict[str, float]:
    """Return the log likelihood ratio of a measured weight for each class; 0 for a class of unknown mass.

    Weights within a class have a normal distribution. The alternative is an object of no declared class,
    whose weight has a uniform distribution from 0 to `MAX_WEIGHT_OF_UNDECLARED_CLASS`.

    Args:
        weight: Measured weight [N].
        std: Standard deviation of the error of the measurement [N].
        classes: Classes of the cell by label.
    """
    ratios = dict.fromkeys(classes, 0.0)
    for label, object_class in classes.items():
        if math.isfinite(object_class.mass_std):
            total_std = math.hypot(std, object_class.mass_std * GRAVITY)
            deviation = (weight - object_class.mass * GRAVITY) / total_std
            log_ratio_of_mean = math.log(MAX_WEIGHT_OF_UNDECLARED_CLASS / (math.sqrt(math.tau) * total_std))
            ratios[label] = log_ratio_of_mean - deviation**2 / 2
    return ratios


def describe_weight(weight: float, label: str, classes: Mapping[str, ObjectClass]) -> str:
    """Return a sentence with a weight [N], and with the weights of the classes that look like `label` [N]."""
    detected_label = classes[label].detected_label
    similar_classes = [other for other in classes.values() if other.detected_label == detected_label]
    weights = " or ".join(f"{other.label} {other.mass * GRAVITY:.2f} N" for other in similar_classes)
    return f"it weighs {weight:.2f} N; expected: {weights}"


def describe_top_contradiction(
    detection: Detection, position: Array, frame: Frame, object_class: ObjectClass
) -> str:
    """Return a sentence on the contradiction between the depth image and the detected class; "" if none.

    The result is also "" for too few depth values. In a stack of two objects, both boxes contain the top of
    the upper object; the height of the stack is permitted for both classes.

    Args:
        detection: Completely visible box and detected class.
        position: Centre of the object `(3,)` [m].
        frame: The searched frame.
        object_class: The detected class.
    """
    try:
        top = measure_top_height(detection, frame)
    except NoDepth:
        return ""
    top_heights = object_class.top_heights
    tolerance = TOP_TOLERANCE * max(1.0, (frame.compute_depth(position) / REFERENCE_DISTANCE) ** 2)
    if min(abs(top - height) for height in top_heights) <= tolerance:
        return ""
    heights = ", ".join(f"{height * 1000:.0f}" for height in top_heights)
    return (
        f"its top is {top * 1000:.0f} mm above the table, and the top of a {detection.label} is at "
        f"{heights} mm"
    )


def describe_size_contradiction(
    detection: Detection, position: Array, frame: Frame, object_class: ObjectClass
) -> str:
    """Return a sentence on the contradiction between the size of a box and its class; "" if none.

    A cylinder with the size of the class encloses the object. The longer side of the box is at most the
    longer side of the image of the cylinder, and at least the side of the square that is inscribed in the
    base of the cylinder. If the class has a footprint, both sides of the box must fit it at one yaw.

    Args:
        detection: Completely visible box and detected class.
        position: Centre of the object `(3,)` [m].
        frame: The searched frame.
        object_class: The detected class.
    """
    if object_class.footprint is not None:
        return _describe_footprint_contradiction(detection, position, frame, object_class)
    left, top, right, bottom = detection.box
    half_height = object_class.height / 2
    cylinder = next(_project_outlines(frame, position, object_class, [-half_height, half_height]))
    projected_length = float(np.ptp(cylinder, axis=(0, 1)).max())
    scale = float(frame.matrix[0, 0]) / frame.compute_depth(position)
    min_length = math.sqrt(2) * object_class.radius * scale * (1 - SIZE_TOLERANCE) - SIZE_TOLERANCE_PX
    max_length = projected_length * (1 + SIZE_TOLERANCE) + SIZE_TOLERANCE_PX
    length = max(right - left, bottom - top)
    if min_length <= length <= max_length:
        return ""
    return (
        f"its box is {length / scale * 1000:.0f} mm long, and the box of a {detection.label} is "
        f"{min_length / scale * 1000:.0f} to {max_length / scale * 1000:.0f} mm long"
    )


def _describe_footprint_contradiction(
    detection: Detection, position: Array, frame: Frame, object_class: ObjectClass
) -> str:
    """Return a sentence if no yaw of the footprint fits both sides of a box, otherwise "".

    The outline is the part of the rectangle within the radius of the class. Each side of the box is at least
    that of the image of the outline at half the height, and at most that of a prism over the outline. The box
    of an object that stands on another one may contain the other one, if both have the same colour.
    """
    half_height = object_class.height / 2
    sides = np.subtract(detection.box[2:], detection.box[:2])
    base = np.empty((0, 2))
    if position[2] - half_height > TOP_TOLERANCE:
        disc = replace(object_class, footprint=None)
        base = next(_project_outlines(frame, position, disc, [-position[2]]))[0]
    for outlines in _project_outlines(frame, position, object_class, [-half_height, 0.0, half_height]):
        outline_sides = np.ptp(outlines[1], axis=0)
        prism_sides = np.ptp(np.concatenate([*outlines, base]), axis=0)
        is_long_enough = sides + SIDE_TOLERANCE_PX >= MIN_SIDE_FRACTION * outline_sides
        is_short_enough = sides - SIDE_TOLERANCE_PX <= MAX_SIDE_FACTOR * prism_sides
        if np.all(is_long_enough & is_short_enough):
            return ""
    size = _format_size(sides * frame.compute_depth(position) / float(frame.matrix[0, 0]))
    expectation = f"a {detection.label}, {_format_size(np.array(object_class.footprint))} from above"
    return f"its box is {size}, and {expectation}, fits it at no yaw"


def _project_outlines(
    frame: Frame, position: Array, object_class: ObjectClass, heights: Sequence[float]
) -> Iterator[Array]:
    """Yield the pixels `(N, 16, 2)` of the outline of a class at some heights, for each of `FOOTPRINT_YAWS`.

    The outline is the part of the footprint within the radius. The N `heights` [m] are relative to the centre
    of the object, `position` `(3,)` [m].
    """
    angles = np.linspace(0, 2 * math.pi, 16, endpoint=False)
    outline = object_class.radius * np.stack([np.cos(angles), np.sin(angles), np.zeros(16)], axis=1)
    if object_class.footprint is not None:
        half_size = np.array(object_class.footprint) / 2
        outline[:, :2] = np.clip(outline[:, :2], -half_size, half_size)
    levels = position + [[(0.0, 0.0, height)] for height in heights]
    for rotation in FOOTPRINT_ROTATIONS:
        yield project(frame.matrix, frame.X_WC, levels + outline @ rotation)


def describe_outline_contradiction(
    look: Detections, detection: Detection, position: Array, object_class: ObjectClass
) -> str:
    """Return a sentence if an object does not look like a prism over the outline of its class, else "".

    The outline of the object is that of the connected pixels that differ from the table, outside of the boxes
    of other detections. The result is also "" for an object on another one, and if the contrast is too small.

    Args:
        look: The detections with their frame.
        detection: Completely visible box and detected class.
        position: Centre of the object `(3,)` [m].
        object_class: The detected class, with a footprint.
    """
    if position[2] - object_class.height / 2 > TOP_TOLERANCE:
        return ""
    frame = look.frame
    outline, is_free = _find_outline(look, detection)
    half_height = object_class.height / 2
    outline_area = cv2.countNonZero(outline)
    if not outline_area:
        return ""
    centroid = _compute_centroid(outline)
    best_overlap = 0.0
    for outlines in _project_outlines(frame, position, object_class, [-half_height, half_height]):
        prism = cv2.convexHull(np.concatenate(outlines).astype(np.float32))
        # The box of the detector may be a pixel off.
        shifted = prism + centroid - _compute_centroid(prism)
        expected = np.zeros_like(outline)
        cv2.fillConvexPoly(expected, shifted.round().astype(np.int32), 1)
        whole_area = cv2.countNonZero(expected)
        expected &= is_free
        expected_area = cv2.countNonZero(expected)
        if outline_area < MIN_SHOWN_PART * expected_area or expected_area < MIN_SHOWN_PART * whole_area:
            return ""
        overlap = cv2.countNonZero(expected & outline) / cv2.countNonZero(expected | outline)
        if overlap >= MIN_OVERLAP:
            return ""
        best_overlap = max(best_overlap, overlap)
    return f"its outline and that of a {detection.label} have {best_overlap:.0%} of their area in common"


def _find_outline(look: Detections, detection: Detection) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return a mask of an object, and a mask of the pixels outside of other boxes.

    The first mask is the convex hull of the connected pixels at the centre of the box that differ from the
    table around it. Both masks cover the box and its surroundings, with a width of half its longer side.
    """
    frame = look.frame
    box = np.array(detection.box)
    margin = (box[2:] - box[:2]).max() / 2
    corner = np.maximum(np.floor(box[:2] - margin), 0).astype(int)
    end = np.ceil(box[2:] + margin).astype(int)
    crop = np.s_[corner[1] : end[1], corner[0] : end[0]]
    image = frame.image[crop].astype(np.int16)
    is_free = frame.visible[crop].astype(np.uint8)
    for other in (*look.confident, *look.doubtful, *look.unknown):
        if other is not detection:
            other_box = np.maximum(np.reshape(other.box, (2, 2)) - corner, 0).round().astype(int)
            is_free[other_box[0, 1] : other_box[1, 1], other_box[0, 0] : other_box[1, 0]] = 0
    is_table = is_free > 0
    inner_box = np.maximum(np.reshape(box, (2, 2)) - corner, 0).round().astype(int)
    is_table[inner_box[0, 1] : inner_box[1, 1], inner_box[0, 0] : inner_box[1, 0]] = False
    outline = np.zeros_like(is_free)
    if not is_table.any():
        return outline, is_free
    deviations = np.abs(image - np.median(image[is_table], axis=0)).max(axis=2)
    noise = 1.4826 * float(np.median(deviations[is_table]))
    mask = (deviations > max(MIN_OUTLINE_CONTRAST, MIN_OUTLINE_STDS * noise)).astype(np.uint8) & is_free
    labels = cv2.connectedComponents(cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((3, 3))))[1]
    column, row = (np.array(detection.centre) - corner).astype(int)
    if labels[row, column]:
        points = cv2.findNonZero((labels == labels[row, column]).astype(np.uint8))
        cv2.fillConvexPoly(outline, cv2.convexHull(points), 1)
    return outline & is_free, is_free


def _compute_centroid(shape: NDArray[Any]) -> Array:
    """Return the centroid `(2,)` [pixel] of a mask `(H, W)` or a polygon `(N, 1, 2)`."""
    moments = cv2.moments(shape)
    return np.array([moments["m10"], moments["m01"]]) / moments["m00"]


def _format_size(sides: Array) -> str:
    """Return two lengths [m] in millimetres."""
    return f"{sides[0] * 1000:.0f} x {sides[1] * 1000:.0f} mm"


def is_completely_visible(detection: Detection, frame: Frame, region: Box) -> bool:
    """Return True if a box is inside the searched region [pixel] and the arm does not occlude it."""
    left, top, right, bottom = detection.box
    border_distance = min(left - region[0], top - region[1], region[2] - right, region[3] - bottom)
    return border_distance >= MIN_BORDER_DISTANCE and frame.compute_visible_fraction(detection.box) >= 1.0
