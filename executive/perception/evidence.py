"""Evidence about the class of an object besides the detector's score: heights, and the size of a box."""

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
from executive.perception.depth_image import measure_top

MAX_HEIGHT_ERROR = 0.003
"""Largest accepted difference between the measured and the expected height of a touch [m]; 52 touches of
`sort_overhead` had errors of at most 0.4 mm."""
OTHER_CLASS_TOLERANCE = 0.0025
"""Tolerance within which a touch that is too low for its class matches another class [m]."""
TOP_TOLERANCE = 0.012
"""Largest accepted difference between the measured and an expected height of a top in the depth image [m].

In 480 scenes of the cell `depth` (60 crowded, 60 with unknown objects), the tops of 1894 correctly detected
objects had a mean error of 2.1 mm and a largest error of 10.1 mm: none contradicted its class. 20 of 26 boxes
of unknown objects contradicted their label.
"""
REFERENCE_DISTANCE = 1.2
"""Largest distance from the camera at which `TOP_TOLERANCE` applies unchanged [m].

At larger distances, the tolerance grows with the squared distance, like stereo noise: from 1.8 m, 160 tops
had errors of at most 18.3 mm, and 27 mm are accepted.
"""
SIZE_TOLERANCE = 0.15
"""Largest relative difference between a box and the sizes that its class allows."""
SIZE_MARGIN = 2.0
"""Margin added to the relative tolerance [pixel]."""
MIN_BORDER_DISTANCE = 2.0
"""Smallest distance to the border of the searched area at which a box is not cut off [pixel]."""


def describe_unknown(counts: Mapping[str, int]) -> str:
    """Return counts of boxes by label in the form `unknown: rubber-duck ×2`, or "" if there are none."""
    listed = ", ".join(f"{label} ×{count}" for label, count in counts.items())  # noqa: RUF001
    return f"unknown: {listed}" if listed else ""


def describe_wrong_height(label: str, height: float, classes: Mapping[str, ObjectClass]) -> str:
    """Return how the height of a touch contradicts a class, or "" if it does not.

    The object stands on the table or on an object of any class.

    Args:
        label: Believed class of the object.
        height: Height of the touch above the table [m].
        classes: Classes of the cell by label.
    """
    if abs(_height_error(label, height, classes)) <= MAX_HEIGHT_ERROR:
        return ""
    measured = f"it was touched {height * 1000:.0f} mm above the table"
    return f"{measured}, and a {label} is {classes[label].height * 1000:.0f} mm high"


def classes_distinct_by_touch(config: CellConfig) -> frozenset[str]:
    """Return the classes whose height differs from that of each other class by more than a touch may err."""
    heights = {label: kind.height for label, kind in config.objects.items()}
    return frozenset(
        label
        for label, height in heights.items()
        if all(abs(height - other) > MAX_HEIGHT_ERROR for name, other in heights.items() if name != label)
    )


def may_miss_top(label: str, height: float, classes: Mapping[str, ObjectClass]) -> bool:
    """Return True if a touch is too low for a class and at the height of no other one.

    Such a touch may have missed the top of the object. The arguments are those of `describe_wrong_height`.
    """
    errors = {other: _height_error(other, height, classes) for other in classes}
    return errors[label] < 0 and all(abs(error) > OTHER_CLASS_TOLERANCE for error in errors.values())


def _height_error(label: str, height: float, classes: Mapping[str, ObjectClass]) -> float:
    """Return the difference [m] between a height and the nearest possible top of a class."""
    return min((height - top for top in _list_tops(label, classes)), key=abs)


def describe_wrong_top(
    detection: Detection, position: Array, frame: Frame, area: Box, classes: Mapping[str, ObjectClass]
) -> str:
    """Return how the height of a top in the depth image contradicts a class, or "" if it does not.

    The object lies on the table or on one object of any class. In a stack, the box of the lower object shows
    the top of the upper one; the sum of both heights fits both classes.

    Args:
        detection: The box and its class.
        position: Centre of the object `(3,)` [m].
        frame: The image. Without a depth image, or with too little depth in the box, nothing is compared.
        area: Searched part of the image [pixel]. Only boxes that show the whole object are compared.
        classes: Classes of the cell by label.
    """
    if not _is_whole(detection, frame, area):
        return ""
    try:
        top = measure_top(detection, frame)
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
    """Return the heights [m] above the table, ascending, at which the top of an object of a class may be.

    The object lies on the table or on one object of any class.
    """
    supports = {0.0, *(other.height for other in classes.values())}
    return sorted(classes[label].height + support for support in supports)


def describe_wrong_size(
    detection: Detection, position: Array, frame: Frame, area: Box, object_class: ObjectClass
) -> str:
    """Return how the size of a box contradicts a class, or "" if it does not.

    A cylinder of its radius and height encloses the class. The longer side of the box is at most that of the
    cylinder's image, and at least a side of the square inscribed in the cylinder's base.

    Args:
        detection: The box and its class.
        position: Centre of the object `(3,)` [m].
        frame: The image.
        area: Searched part of the image [pixel]. Only boxes that show the whole object are compared.
        object_class: The class.
    """
    if not _is_whole(detection, frame, area):
        return ""
    left, top, right, bottom = detection.box
    sides = _project_cylinder(position, frame, object_class)
    scale = float(frame.matrix[0, 0]) / frame.compute_depth(position)
    shortest = math.sqrt(2) * object_class.radius * scale * (1 - SIZE_TOLERANCE) - SIZE_MARGIN
    longest = max(sides) * (1 + SIZE_TOLERANCE) + SIZE_MARGIN
    measured = max(right - left, bottom - top)
    if shortest <= measured <= longest:
        return ""
    return (
        f"its box is {measured / scale * 1000:.0f} mm long, and that of a {detection.label} is "
        f"{shortest / scale * 1000:.0f} to {longest / scale * 1000:.0f} mm long"
    )


def _is_whole(detection: Detection, frame: Frame, area: Box) -> bool:
    """Return True if neither the border of the searched area nor the arm cuts off part of a box."""
    left, top, right, bottom = detection.box
    border_distance = min(left - area[0], top - area[1], area[2] - right, area[3] - bottom)
    return border_distance >= MIN_BORDER_DISTANCE and frame.compute_visible_fraction(detection.box) >= 1.0


def _project_cylinder(position: Array, frame: Frame, object_class: ObjectClass) -> tuple[float, float]:
    """Return width and height [pixel] of the box around the image of the cylinder that encloses a class."""
    angles = np.linspace(0, 2 * math.pi, 16, endpoint=False)
    x, y = object_class.radius * np.cos(angles), object_class.radius * np.sin(angles)
    rims = [np.stack((x, y, np.full(16, level * object_class.height)), axis=1) for level in (-0.5, 0.5)]
    width, height = np.ptp(project(frame.matrix, frame.X_WC, position + np.concatenate(rims)), axis=0)
    return float(width), float(height)
