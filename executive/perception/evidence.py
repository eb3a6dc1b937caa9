"""Evidence about a detected class: weight, height in the depth image, size of the box.

An object may stand on the table or on one object of any class. In the functions, `label` is the assumed class
of the object, and `classes` contains the classes of the cell by label.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from executive.cell.frame import Box, Detection, Frame
from executive.cell.objects import ObjectClass, list_top_heights
from executive.errors import NoDepth
from executive.geometry import GRAVITY, Array
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
    detection: Detection, position: Array, frame: Frame, classes: Mapping[str, ObjectClass]
) -> str:
    """Return a sentence on the contradiction between the depth image and the detected class; "" if none.

    The result is also "" for too few depth values. In a stack of two objects, both boxes contain the top of
    the upper object; the height of the stack is permitted for both classes.

    Args:
        detection: Completely visible box and detected class.
        position: Centre of the object `(3,)` [m].
        frame: The searched frame.
        classes: Classes of the cell by label.
    """
    try:
        top = measure_top_height(detection, frame)
    except NoDepth:
        return ""
    top_heights = list_top_heights(detection.label, classes)
    tolerance = TOP_TOLERANCE * max(1.0, (frame.compute_depth(position) / REFERENCE_DISTANCE) ** 2)
    if min(abs(top - height) for height in top_heights) <= tolerance:
        return ""
    *lower, highest = [f"{height * 1000:.0f}" for height in top_heights]
    return (
        f"its top is {top * 1000:.0f} mm above the table, and the top of a {detection.label} is at "
        f"{', '.join(lower)} or {highest} mm"
    )


def describe_size_contradiction(
    detection: Detection, position: Array, frame: Frame, object_class: ObjectClass
) -> str:
    """Return a sentence on the contradiction between the size of a box and its class; "" if none.

    A cylinder with the size of the class encloses the object. The longer side of the box is at most the
    longer side of the image of the cylinder, and at least the side of the square that is inscribed in the
    base of the cylinder.

    Args:
        detection: Completely visible box and detected class.
        position: Centre of the object `(3,)` [m].
        frame: The searched frame.
        object_class: The detected class.
    """
    left, top, right, bottom = detection.box
    angles = np.linspace(0, 2 * math.pi, 16, endpoint=False)
    x = object_class.radius * np.cos(angles)
    y = object_class.radius * np.sin(angles)
    half = object_class.height / 2
    circles = [np.stack((x, y, np.full(16, z)), axis=1) for z in (-half, half)]
    cylinder = project(frame.matrix, frame.X_WC, position + np.concatenate(circles))
    projected_length = float(np.ptp(cylinder, axis=0).max())
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


def is_completely_visible(detection: Detection, frame: Frame, region: Box) -> bool:
    """Return True if a box is inside the searched region [pixel] and the arm does not occlude it."""
    left, top, right, bottom = detection.box
    border_distance = min(left - region[0], top - region[1], region[2] - right, region[3] - bottom)
    return border_distance >= MIN_BORDER_DISTANCE and frame.compute_visible_fraction(detection.box) >= 1.0
