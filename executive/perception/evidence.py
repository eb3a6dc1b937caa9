"""Tests of a detected class by other evidence than the confidence: measured heights, and box size."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from executive.cell.config import CellConfig
from executive.cell.detection import Detection
from executive.cell.frame import Box, Frame
from executive.cell.objects import ObjectClass
from executive.errors import NoDepth
from executive.geometry import Array
from executive.perception.camera_model import project
from executive.perception.depth_image import measure_top_height

MAX_TOUCH_HEIGHT_ERROR = 0.003
"""Maximum difference between the height of a touch and the expected height of a class [m]; 52 touches of
the mission `sort_overhead` had errors of at most 0.4 mm."""
OTHER_CLASS_TOLERANCE = 0.0025
"""Maximum height difference at which a touch that is too low for its class matches another class [m]."""
TOP_TOLERANCE = 0.012
"""Maximum difference between the height of a top in the depth image and an expected height [m].

In 480 scenes of the cell `depth` (60 crowded, 60 with unknown objects), the tops of 1894 correctly detected
objects had a mean error of 2.1 mm and a maximum error of 10.1 mm: none contradicted its class. 20 of 26 boxes
of unknown objects contradicted their label.
"""
REFERENCE_DISTANCE = 1.2
"""Maximum distance from the camera at which `TOP_TOLERANCE` applies [m].

At larger distances, the tolerance grows with the squared distance, like the noise of a stereo camera: at
1.8 m, the tolerance is 27 mm, and 160 tops had errors of at most 18.3 mm.
"""
SIZE_TOLERANCE = 0.15
"""Maximum relative difference between the size of a box and the sizes that its class allows."""
SIZE_MARGIN = 2.0
"""Absolute tolerance that is added to `SIZE_TOLERANCE` [pixel]."""
MIN_BORDER_DISTANCE = 2.0
"""Boxes nearer to the border of the searched region may be truncated [pixel]."""


def describe_unknown_labels(counts: Mapping[str, int]) -> str:
    """Return the counts of boxes by unknown label as a text: `unknown: rubber-duck ×2`; "" if empty."""
    items = ", ".join(f"{label} ×{count}" for label, count in counts.items())  # noqa: RUF001
    return f"unknown: {items}" if items else ""


def describe_touch_contradiction(label: str, height: float, classes: Mapping[str, ObjectClass]) -> str:
    """Return a sentence if the height of a touch contradicts a class, otherwise "".

    The object may stand on the table or on one object of any class.

    Args:
        label: Assumed class of the object.
        height: Height of the touch above the table [m].
        classes: Classes of the cell by label.
    """
    if abs(_compute_height_error(label, height, classes)) <= MAX_TOUCH_HEIGHT_ERROR:
        return ""
    measured = f"it was touched {height * 1000:.0f} mm above the table"
    return f"{measured}, and a {label} is {classes[label].height * 1000:.0f} mm high"


def find_classes_distinct_by_touch(config: CellConfig) -> frozenset[str]:
    """Return the classes whose heights differ from all others by more than `MAX_TOUCH_HEIGHT_ERROR`."""
    heights = {label: kind.height for label, kind in config.objects.items()}
    return frozenset(
        label
        for label, height in heights.items()
        if all(
            abs(height - other) > MAX_TOUCH_HEIGHT_ERROR for name, other in heights.items() if name != label
        )
    )


def may_miss_top(label: str, height: float, classes: Mapping[str, ObjectClass]) -> bool:
    """Return True if a touch is too low for a class and at the height of no other class.

    The touch may have missed the top of the object.

    Args:
        label: Assumed class of the object.
        height: Height of the touch above the table [m].
        classes: Classes of the cell by label.
    """
    errors = {other: _compute_height_error(other, height, classes) for other in classes}
    return errors[label] < 0 and all(abs(error) > OTHER_CLASS_TOLERANCE for error in errors.values())


def _compute_height_error(label: str, height: float, classes: Mapping[str, ObjectClass]) -> float:
    """Return the signed difference [m] between a height and the nearest possible top of a class."""
    return min((height - top for top in _list_tops(label, classes)), key=abs)


def describe_top_contradiction(
    detection: Detection, position: Array, frame: Frame, area: Box, classes: Mapping[str, ObjectClass]
) -> str:
    """Return a sentence if the height of a top in the depth image contradicts a class, otherwise "".

    The object may lie on the table or on one object of any class. In a stack, the box of the lower object
    shows the top of the upper object; the sum of both heights is valid for both classes.

    Args:
        detection: The box and its class.
        position: Centre of the object `(3,)` [m].
        frame: The frame. Without enough depth values in the box, the result is "".
        area: Searched region of the image [pixel]. For a truncated or occluded box, the result is "".
        classes: Classes of the cell by label.
    """
    if not _is_whole(detection, frame, area):
        return ""
    try:
        top = measure_top_height(detection, frame)
    except NoDepth:
        return ""
    expected = _list_tops(detection.label, classes)
    tolerance = TOP_TOLERANCE * max(1.0, (frame.compute_depth(position) / REFERENCE_DISTANCE) ** 2)
    if min(abs(top - height) for height in expected) <= tolerance:
        return ""
    *lower, highest = [f"{height * 1000:.0f}" for height in expected]
    measured = f"its top is {top * 1000:.0f} mm above the table"
    return f"{measured}, and that of a {detection.label} {', '.join(lower)} or {highest} mm"


def _list_tops(label: str, classes: Mapping[str, ObjectClass]) -> list[float]:
    """Return all possible heights [m] above the table of the top of an object of a class, ascending.

    The object may lie on the table or on one object of any class.
    """
    supports = {0.0, *(other.height for other in classes.values())}
    return sorted(classes[label].height + support for support in supports)


def describe_size_contradiction(
    detection: Detection, position: Array, frame: Frame, area: Box, object_class: ObjectClass
) -> str:
    """Return a sentence if the size of a box contradicts a class, otherwise "".

    A cylinder with the radius and height of the class encloses the object. The longer side of the box is at
    most the longer side of the image of the cylinder, and at least the side of the square inscribed in the
    base of the cylinder.

    Args:
        detection: The box and its class.
        position: Centre of the object `(3,)` [m].
        frame: The frame.
        area: Searched region of the image [pixel]. For a truncated or occluded box, the result is "".
        object_class: Class of the object.
    """
    if not _is_whole(detection, frame, area):
        return ""
    left, top, right, bottom = detection.box
    sides = _project_cylinder(position, frame, object_class)
    scale = float(frame.matrix[0, 0]) / frame.compute_depth(position)
    min_length = math.sqrt(2) * object_class.radius * scale * (1 - SIZE_TOLERANCE) - SIZE_MARGIN
    max_length = max(sides) * (1 + SIZE_TOLERANCE) + SIZE_MARGIN
    length = max(right - left, bottom - top)
    if min_length <= length <= max_length:
        return ""
    return (
        f"its box is {length / scale * 1000:.0f} mm long, and that of a {detection.label} is "
        f"{min_length / scale * 1000:.0f} to {max_length / scale * 1000:.0f} mm long"
    )


def _is_whole(detection: Detection, frame: Frame, area: Box) -> bool:
    """Return True if a box is neither truncated by the searched region nor occluded by the arm."""
    left, top, right, bottom = detection.box
    border_distance = min(left - area[0], top - area[1], area[2] - right, area[3] - bottom)
    return border_distance >= MIN_BORDER_DISTANCE and frame.compute_visible_fraction(detection.box) >= 1.0


def _project_cylinder(position: Array, frame: Frame, object_class: ObjectClass) -> tuple[float, float]:
    """Return width and height [pixel] of the image of a cylinder with the size of a class."""
    angles = np.linspace(0, 2 * math.pi, 16, endpoint=False)
    x, y = object_class.radius * np.cos(angles), object_class.radius * np.sin(angles)
    circles = [np.stack((x, y, np.full(16, level * object_class.height)), axis=1) for level in (-0.5, 0.5)]
    width, height = np.ptp(project(frame.matrix, frame.X_WC, position + np.concatenate(circles)), axis=0)
    return float(width), float(height)
