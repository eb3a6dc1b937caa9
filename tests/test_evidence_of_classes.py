"""Evidence about the class of an object besides the detector's score."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from executive.cell.frame import Box, Detection, Detections, ErrorRates, Frame
from executive.cell.objects import ObjectClass
from executive.geometry import rotate_about_z
from executive.perception.camera_model import project
from executive.perception.evidence import (
    describe_outline_contradiction,
    describe_size_contradiction,
    describe_top_contradiction,
    describe_unknown_labels,
)
from executive.perception.localization import CellLocalizer
from tests.camera_poses import looking_down

CUBE, SPHERE = ObjectClass("cube", 0.05, 0.0354), ObjectClass("sphere", 0.06, 0.03)
CLASSES = {
    "cube": CUBE, "sphere": SPHERE, "duck": ObjectClass("duck", 0.056, 0.0295),
}  # fmt: skip
STACKED = (0.0, 0.05, 0.056, 0.06)
FRAME = Frame(
    1, "overhead", np.zeros((480, 640, 3), np.uint8), None,
    np.array([[461.0, 0, 319.5], [0, 461.0, 239.5], [0, 0, 1]]), looking_down((0.5, 0.0, 1.2)), 0.0,
    np.ones((480, 640), bool), 0,
)  # fmt: skip
AREA: Box = (192.0, 100.0, 448.0, 356.0)


@pytest.mark.parametrize(
    ("side", "contradiction"),
    [
        (24.0, ""),
        (40.0, "its box is 102 mm long, and the box of a sphere is 31 to 76 mm long"),
        (10.0, "its box is 25 mm long, and the box of a sphere is 31 to 76 mm long"),
    ],
)
def test_the_size_of_a_box_has_to_be_that_of_the_class(side, contradiction):
    box = (319.5 - side / 2, 239.5 - side / 2, 319.5 + side / 2, 239.5 + side / 2)
    place = np.array([0.5, 0.0, 0.03])
    assert describe_size_contradiction(Detection("sphere", 0.9, box), place, FRAME, SPHERE) == contradiction


@pytest.mark.parametrize("yaw_deg", [0, 20, 45, 70])
@pytest.mark.parametrize(("length", "fits"), [(0.05, True), (0.08, False), (0.09, False)])
def test_both_sides_of_a_box_have_to_fit_the_footprint_at_one_yaw(yaw_deg, length, fits):
    place = np.array([0.6, 0.15, 0.025])
    corners = np.array([*itertools.product((-1, 1), repeat=3)]) * (length / 2, 0.025, 0.025)
    pixels = project(FRAME.matrix, FRAME.X_WC, place + corners @ rotate_about_z(math.radians(yaw_deg)).T)
    box = Detection("cube", 0.9, (*pixels.min(axis=0), *pixels.max(axis=0)))
    cube = replace(CUBE, footprint=(0.05, 0.05))
    assert (describe_size_contradiction(box, place, FRAME, cube) == "") is fits


def test_the_box_of_a_cube_on_another_one_may_contain_both():
    place = np.array([0.64, -0.22, 0.075])
    corners = np.array([*itertools.product((-0.025, 0.025), (-0.025, 0.025), (-0.075, 0.025))])
    pixels = project(FRAME.matrix, FRAME.X_WC, place + corners @ rotate_about_z(math.radians(45)).T)
    box = Detection("cube", 0.9, (*pixels.min(axis=0), *pixels.max(axis=0)))
    cube = replace(CUBE, footprint=(0.05, 0.05))
    assert describe_size_contradiction(box, place, FRAME, cube) == ""
    assert describe_size_contradiction(box, place - (0, 0, 0.05), FRAME, cube)


@pytest.mark.parametrize(
    ("sides", "shown_fraction", "contrast", "fits"),
    [
        ((0.05, 0.05), 1.0, 100, True),
        ((0.065, 0.05), 1.0, 100, False),
        ((0.07, 0.035), 1.0, 100, False),
        ((0.09, 0.05), 0.7, 100, False),
        ((0.07, 0.035), 1.0, 5, True),
    ],
    ids=[
        "cube",
        "slightly longer brick",
        "brick with the box of a cube",
        "box of a part of a brick",
        "without contrast",
    ],
)
def test_the_pixels_of_an_object_have_to_fill_the_outline_of_its_class(sides, shown_fraction, contrast, fits):
    place = np.array([0.5, 0.0, 0.025])
    corners = np.array([*itertools.product((-0.5, 0.5), repeat=3)]) * (*sides, 0.05)
    pixels = project(FRAME.matrix, FRAME.X_WC, place + corners @ rotate_about_z(math.radians(45)).T)
    image = np.full((480, 640, 3), 120, np.uint8)
    cv2.fillConvexPoly(image, cv2.convexHull(pixels.round().astype(np.int32)), (120 + contrast, 120, 120))
    low = pixels.min(axis=0)
    box = Detection("cube", 0.9, (*low, *low + shown_fraction * np.ptp(pixels, axis=0)))
    rates = ErrorRates(0.5, 0.01, 0.01, 0.01, 1.0)
    frame = replace(FRAME, image=image)
    look = Detections("eye", (box,), rates, frame=frame, view="table", area=AREA)
    cube = replace(CUBE, footprint=(0.05, 0.05))
    assert (describe_outline_contradiction(look, box, place, cube) == "") is fits


def observe_sphere(box: Box, frame: Frame) -> str:
    """Return the contradiction of a box to the class of a sphere."""
    found = Detection("sphere", 0.9, box)
    rates = ErrorRates(0.5, 0.01, 0.01, 0.01, 1.0)
    detections = Detections("eye", (found,), rates, frame=frame, view="table", area=AREA)
    (observation,) = CellLocalizer("plane", CLASSES).localize(detections)
    return observation.contradiction


LARGE = (299.5, 219.5, 339.5, 259.5)


def test_a_box_that_the_searched_area_or_the_arm_cuts_off_is_not_compared():
    assert observe_sphere((192.5, 230.0, 200.0, 240.0), FRAME) == ""
    assert observe_sphere((192.5, 230.0, 200.0, 240.0), show_top(0.3)) == ""
    behind = np.ones((480, 640), bool)
    behind[230:235] = False
    assert observe_sphere(LARGE, FRAME).startswith("its box is 102 mm long")
    assert observe_sphere(LARGE, replace(FRAME, visible=behind)) == ""


BOX = (310.0, 230.0, 330.0, 250.0)


def show_top(height: float, camera: float = 1.2) -> Frame:
    """Return a frame whose depth image shows a plane; heights are over the table [m]."""
    depth = np.full((480, 640), camera - height)
    return replace(FRAME, depth=depth, X_WC=looking_down((0.5, 0.0, camera)))


def describe_top(label: str, frame: Frame, supports: tuple[float, ...] = STACKED) -> str:
    """Return how the top in a box contradicts the class of an object on the table."""
    place = np.array([0.5, 0.0, 0.025])
    stacked = replace(CLASSES[label], support_heights=supports)
    return describe_top_contradiction(Detection(label, 0.9, BOX), place, frame, stacked)


@pytest.mark.parametrize(
    ("label", "height", "contradiction"),
    [
        ("cube", 0.05, ""),
        ("cube", 0.061, ""),  # the error of a depth image
        (
            "cube",
            0.08,
            "its top is 80 mm above the table, and the top of a cube is at 50, 100, 106, 110 mm",
        ),
        (
            "duck",
            0.02,
            "its top is 20 mm above the table, and the top of a duck is at 56, 106, 112, 116 mm",
        ),
    ],
)
def test_the_height_of_a_top_in_the_depth_image_has_to_be_that_of_the_class(label, height, contradiction):
    assert describe_top(label, show_top(height)) == contradiction


def test_a_tower_is_no_stack_in_a_cell_without_stacks():
    assert describe_top("cube", show_top(0.1)) == ""
    tower = describe_top("cube", show_top(0.1), supports=(0.0,))
    assert tower == "its top is 100 mm above the table, and the top of a cube is at 50 mm"


@pytest.mark.parametrize("depth", [None, np.full((480, 640), np.nan)])
def test_without_depth_no_top_is_compared(depth):
    assert describe_top("cube", replace(FRAME, depth=depth)) == ""


def test_the_tolerance_of_a_top_grows_with_the_square_of_the_distance():
    assert describe_top("cube", show_top(0.075, camera=1.225))
    assert describe_top("cube", show_top(0.075, camera=1.825)) == ""
    assert describe_top("cube", show_top(0.02, camera=1.825))


def test_unknown_labels_are_listed_with_their_counts():
    expected = "unknown: rubber-duck ×2, mug ×1"  # noqa: RUF001
    assert describe_unknown_labels({"rubber-duck": 2, "mug": 1}) == expected
    assert describe_unknown_labels({}) == ""
