"""Evidence about the class of an object besides the detector's score: heights, and the size of a box."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from executive.depth_image import measure_top
from executive.errors import NoDepth
from executive.geometry import Array
from executive.messages import Box, Detection, Frame, ObjectClass

MAX_HEIGHT_ERROR = 0.003
"""Largest accepted difference between the measured and the expected height of a touch [m]; 52 touches of
`sort_overhead` were at most 0.4 mm off."""
OTHER_CLASS_TOLERANCE = 0.0025
"""Tolerance within which a touch that is too low for its class matches another class [m]."""
TOP_TOLERANCE = 0.012
"""Largest accepted difference between the measured and an expected height of a top in the depth image [m].

In 480 scenes of the cell `depth`, 60 of them crowded and 60 with unknown objects, the tops of 1894 rightly
detected objects were measured within 2.1 mm in the mean and 10.1 mm at worst: none contradicted its class.
20 of the 26 boxes around unknown objects contradicted theirs.
"""
TOP_DISTANCE = 1.2
"""Distance from the camera at which the above was measured [m].

Beyond, the tolerance grows with the square of the distance, as the noise of a stereo camera does: seen from
1.8 m, 160 tops were measured within 18.3 mm, and 27 mm are accepted.
"""
SIZE_TOLERANCE = 0.15
"""Largest relative difference between a box and the sizes that its class allows."""
SIZE_MARGIN = 2.0
"""Margin added to the relative tolerance [pixel]."""
BORDER_DISTANCE = 2.0
"""Distance to the border of the searched area under which a box may be cut off [pixel]."""


def describe_unknown(counts: Mapping[str, int]) -> str:
    """Return counts of boxes by label in the form `unknown: rubber-duck ×2`, or "" if there are none."""
    listed = ", ".join(f"{label} ×{count}" for label, count in counts.items())  # noqa: RUF001
    return f"unknown: {listed}" if listed else ""


def describe_wrong_height(label: str, height: float, classes: Mapping[str, ObjectClass]) -> str:
    """Return how the height of a touch contradicts a class, or "" if it does not.

    The object stands on the table or on an object of any class.

    Args:
        label: Class that the object is believed to be of.
        height: Height of the touch above the table [m].
        classes: Classes of the cell by label.
    """
    if abs(_height_error(label, height, classes)) <= MAX_HEIGHT_ERROR:
        return ""
    measured = f"it was touched {height * 1000:.0f} mm above the table"
    return f"{measured}, and a {label} is {classes[label].height * 1000:.0f} mm high"


def may_miss_top(label: str, height: float, classes: Mapping[str, ObjectClass]) -> bool:
    """Return True if a touch is too low for a class and at the height of no other one.

    It may have missed the top of the object. The arguments are those of `describe_wrong_height`.
    """
    errors = {other: _height_error(other, height, classes) for other in classes}
    return errors[label] < 0 and all(abs(error) > OTHER_CLASS_TOLERANCE for error in errors.values())


def _height_error(label: str, height: float, classes: Mapping[str, ObjectClass]) -> float:
    """Return the difference [m] between a height and the nearest height of a top of a class."""
    return min((height - top for top in _list_tops(label, classes)), key=abs)


def describe_wrong_top(
    detection: Detection, position: Array, frame: Frame, area: Box, classes: Mapping[str, ObjectClass]
) -> str:
    """Return how the height of a top in the depth image contradicts a class, or "" if it does not.

    The object lies on the table or on one object of any class. The box of the lower of two objects shows the
    top of the upper one: the sum of both heights contradicts neither class.

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
    tolerance = TOP_TOLERANCE * max(1.0, (_depth_of(position, frame) / TOP_DISTANCE) ** 2)
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
    detection: Detection, position: Array, frame: Frame, area: Box, kind: ObjectClass
) -> str:
    """Return how the size of a box contradicts a class, or "" if it does not.

    The class is enclosed by a cylinder of its radius and height. The longer side of the box is at
    most that of the box around the cylinder's image, and at least a side of the square inscribed in its base.

    Args:
        detection: The box and its class.
        position: Centre of the object `(3,)` [m].
        frame: The image.
        area: Searched part of the image [pixel]. Only boxes that show the whole object are compared.
        kind: The class.
    """
    if not _is_whole(detection, frame, area):
        return ""
    left, top, right, bottom = detection.box
    sides = _project_cylinder(position, frame, kind)
    scale = float(frame.matrix[0, 0]) / _depth_of(position, frame)
    shortest = math.sqrt(2) * kind.radius * scale * (1 - SIZE_TOLERANCE) - SIZE_MARGIN
    longest = max(sides) * (1 + SIZE_TOLERANCE) + SIZE_MARGIN
    measured = max(right - left, bottom - top)
    if shortest <= measured <= longest:
        return ""
    return (
        f"its box is {measured / scale * 1000:.0f} mm long, and that of a {detection.label} is "
        f"{shortest / scale * 1000:.0f} to {longest / scale * 1000:.0f} mm long"
    )


def _is_whole(detection: Detection, frame: Frame, area: Box) -> bool:
    """Return False if the border of the searched area may cut a box off, or the arm hides part of it."""
    left, top, right, bottom = detection.box
    border_distance = min(left - area[0], top - area[1], area[2] - right, area[3] - bottom)
    return border_distance >= BORDER_DISTANCE and frame.shown(detection.box) >= 1.0


def _depth_of(position: Array, frame: Frame) -> float:
    """Return the distance [m] of a point `(3,)` [m] from the camera, along the optical axis."""
    return float(frame.X_WC.inverse().apply(position)[2])


def _project_cylinder(position: Array, frame: Frame, kind: ObjectClass) -> tuple[float, float]:
    """Return width and height [pixel] of the box around the image of the cylinder that encloses a class."""
    angles = np.linspace(0, 2 * math.pi, 16, endpoint=False)
    x, y = kind.radius * np.cos(angles), kind.radius * np.sin(angles)
    rims = [np.stack((x, y, np.full(16, z)), axis=1) for z in (-kind.height / 2, kind.height / 2)]
    points = frame.X_WC.inverse().apply(position + np.concatenate(rims)) @ frame.matrix.T
    width, height = np.ptp(points[:, :2] / points[:, 2:], axis=0)
    return float(width), float(height)
