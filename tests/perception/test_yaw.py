"""The angle of an object about the vertical axis, from drawn outlines."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from executive.cell.frame import Detection, Detections, Frame, assume_rates
from executive.cell.objects import GraspPoint, ObjectClass
from executive.geometry import Array, Yaw, rotate_about_z
from executive.perception.camera_model import compute_camera_matrix, compute_look_at_pose, project
from executive.perception.localization import CellLocalizer
from executive.perception.yaw import measure_yaw

K = compute_camera_matrix(640, 480, 55)
EYE = compute_look_at_pose([0.45, 0.1, 1.2], [0.5, 0.0, 0.0], [1, 0, 0])
AREA = (192.0, 100.0, 448.0, 356.0)
TABLE = (150, 120, 90)
RED = (200, 60, 50)
PLACE = np.array([0.5, 0.0, 0.025])
QUARTER = math.pi / 4

SQUARE = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * 0.025
PLATE = np.array([(0.04, 0.015), (-0.04, 0.015), (-0.04, -0.015), (0.04, -0.015)])
WEDGE = np.array([(0.04, 0.005), (-0.04, 0.02), (-0.04, -0.02), (0.04, -0.005)])
ROOF = np.array([(-0.045, -0.015), (0.045, -0.015), (0.02, 0.015), (-0.02, 0.015)])
"""Outline whose ends look alike, but not its sides."""
NUT = 0.03 * np.array([(math.cos(k * math.pi / 3), math.sin(k * math.pi / 3)) for k in range(6)])
DISC = 0.03 * np.array([(math.cos(k / 10), math.sin(k / 10)) for k in range(63)])


def make_class(outline: Array, symmetry: int, offset: float = 0.0) -> ObjectClass:
    length, width = np.ptp(outline, axis=0)
    radius = float(np.linalg.norm(outline, axis=1).max())
    return ObjectClass(
        "part", 0.05, radius, footprint=(float(length), float(width)), flat_top=True, yaw_symmetry=symmetry,
        yaw_offset=offset,
    )  # fmt: skip


def find_pixels(outline: Array, yaw: float, place: Array = PLACE) -> Array:
    """Return the image `(N, 2)` [pixel] of an outline `(N, 2)` [m] with a yaw."""
    points = np.column_stack([outline, np.zeros(len(outline))]) @ rotate_about_z(yaw).T
    return project(K, EYE, place + points)


def draw(*shapes: tuple[Array, tuple[int, int, int]], visible: bool = True) -> Frame:
    """Return a noisy image of coloured polygons `(N, 2)` [pixel] on the table."""
    image = np.full((480, 640, 3), TABLE, float)
    for pixels, colour in shapes:
        # Each pixel is the mean of 8 x 8 parts. The centre of the first one is (0, 0) for OpenCV.
        parts = np.zeros((8 * 480, 8 * 640), np.float32)
        cv2.fillPoly(parts, [((8 * pixels - 0.5) * 16).round().astype(np.int32)], 1.0, shift=4)
        cover = cv2.resize(parts, (640, 480), interpolation=cv2.INTER_AREA)[..., None]
        image += cover * (np.array(colour) - image)
    noise = np.random.default_rng(1).normal(0, 3, image.shape)
    mask = np.full((480, 640), visible)
    return Frame(1, "eye", (image + noise).clip(0, 255).astype(np.uint8), None, K, EYE, 0.0, mask, 0)


def box_around(pixels: Array) -> Detection:
    left, top = pixels.min(axis=0).tolist()
    right, bottom = pixels.max(axis=0).tolist()
    return Detection("part", 0.9, (left + 0.4, top - 0.5, right + 0.6, bottom + 0.3))


def look_at(frame: Frame, *detections: Detection) -> Detections:
    return Detections("eye", detections, assume_rates(0.5, ""), frame=frame, view="table", area=AREA)


def measure(
    frame: Frame, pixels: Array, part: ObjectClass, outline: Sequence[Sequence[float]] = ()
) -> Yaw | None:
    detection = replace(box_around(pixels), outline=tuple((x, y) for x, y in outline))
    found = measure_yaw(look_at(frame, detection), detection, PLACE, part)
    return found and found[0]


@settings(max_examples=30, deadline=None)
@given(
    st.sampled_from([(SQUARE, 4, QUARTER), (PLATE, 2, 0.0), (WEDGE, 1, 0.0), (ROOF, 1, 0.0), (NUT, 6, 0.0)]),
    st.floats(-math.pi, math.pi),
    st.floats(0.42, 0.6),
    st.floats(-0.2, 0.2),
)
@example((WEDGE, 1, 0.0), 0.1, 0.5, 0.0)
@example((WEDGE, 1, 0.0), 0.1 + math.pi, 0.5, 0.0)
def test_the_yaw_of_every_symmetry_is_found(
    shape: tuple[Array, int, float], yaw: float, x: float, y: float
) -> None:
    outline, symmetry, offset = shape
    place = np.array([x, y, 0.025])
    pixels = find_pixels(outline, yaw, place)
    detection = box_around(pixels)
    part = make_class(outline, symmetry, offset)
    result = measure_yaw(look_at(draw((pixels, RED)), detection), detection, place, part)
    assert result is not None
    found, middle = result
    assert middle == pytest.approx(place, abs=0.0015)  # half a pixel is 1.3 mm
    assert found.symmetry == symmetry
    error = math.remainder(found.angle - yaw, math.tau / symmetry)
    assert abs(error) <= min(4 * found.std, math.radians(3))
    assert abs(found.angle) <= math.pi / symmetry
    assert 0.0005 < found.std < math.radians(2)


def test_two_ends_that_look_alike_stay_open_and_the_offset_turns_the_result() -> None:
    pixels = find_pixels(PLATE, 0.3)
    found = measure(draw((pixels, RED)), pixels, make_class(PLATE, 1, offset=0.1))
    assert found is not None
    assert found.symmetry == 2
    assert found.angle == pytest.approx(0.2, abs=4 * found.std)


def test_a_smaller_and_a_rounder_image_are_less_certain_and_an_uneven_top_too() -> None:
    def find_std(outline: Array, **changes: bool) -> float:
        pixels = find_pixels(outline, 0.3)
        found = measure(draw((pixels, RED)), pixels, replace(make_class(outline, 2), **changes))
        assert found is not None
        return found.std

    std = find_std(PLATE)
    assert find_std(PLATE / 2) == pytest.approx(std * 2**1.5, rel=0.2), "the errors of pixels average out"
    assert find_std(PLATE * (0.7, 1.4)) > 2 * std
    assert find_std(PLATE, flat_top=False) > 1.2 * std, "seen from the side, it is no prism"


def test_without_a_plausible_outline_there_is_no_yaw() -> None:
    pixels = find_pixels(SQUARE, 0.3)
    cube = make_class(SQUARE, 4, QUARTER)
    assert measure(draw((pixels, RED)), pixels, cube) is not None
    assert measure(draw((pixels, RED)), pixels, replace(cube, yaw_symmetry=0)) is None, "round"
    assert measure(draw((pixels, RED), visible=False), pixels, cube) is None, "occluded by the arm"
    assert measure(draw(), pixels, cube) is None, "nothing but noise"
    assert measure(draw(), pixels[:1], cube) is None, "a box of one pixel"
    stripe = find_pixels(SQUARE * (0.3, 1.0), 0.3)
    assert measure(draw((stripe, RED)), pixels, cube) is None, "only a part differs from the table"
    beside = pixels + np.array([AREA[0] - pixels[:, 0].min() + 1, 0])
    assert measure(draw((beside, RED)), beside, cube) is None, "cut off by the border of the view"
    disc = find_pixels(DISC, 0.3)
    found = measure(draw((disc, RED)), disc, make_class(DISC, 4))
    assert found is None or found.std > math.radians(5), "a disc instead of a cube"


def test_grabcut_finds_an_object_of_two_colours() -> None:
    pixels = find_pixels(SQUARE, 0.3)
    half = find_pixels(SQUARE * (0.5, 1.0) - (0.0125, 0.0), 0.3)
    frame = draw((pixels, (175, 140, 95)), (half, (20, 20, 230)))
    found = measure(frame, pixels, make_class(SQUARE, 4, QUARTER))
    assert found is not None
    assert math.degrees(found.angle) == pytest.approx(math.degrees(0.3), abs=2)


def test_the_outline_of_a_detector_is_preferred_if_it_fits_the_box() -> None:
    pixels = find_pixels(PLATE, 0.3)
    plate = make_class(PLATE, 2)
    by_colour = measure(draw((pixels, RED)), pixels, plate)
    by_outline = measure(draw(), pixels, plate, pixels)
    assert by_colour is not None
    assert by_outline is not None
    assert by_outline.angle == pytest.approx(0.3, abs=1e-6)
    assert by_outline == pytest.approx(measure(draw(), pixels, plate, pixels[::-1]))
    assert by_outline.std > by_colour.std
    for wrong in (pixels * 0.9, pixels[:2], [(math.nan, 0.0)] * 4):
        assert measure(draw((pixels, RED)), pixels, plate, wrong) == by_colour


@pytest.mark.parametrize("has_depth", [True, False])
def test_only_a_depth_image_shows_an_object_on_another_one_of_its_colour(has_depth: bool) -> None:
    upper_place = PLACE + np.array([0, 0, 0.05])
    lower = find_pixels(SQUARE, 0.7)
    upper = find_pixels(SQUARE, 0.3, upper_place)
    frame = draw((lower, RED), (upper, RED))
    height = np.zeros((480, 640))
    cv2.fillPoly(height, [lower.round().astype(np.int32)], 0.05)
    cv2.fillPoly(height, [upper.round().astype(np.int32)], 0.1)
    rays = np.stack([*np.meshgrid(np.arange(640) + 0.5, np.arange(480) + 0.5), np.ones((480, 640))], axis=-1)
    drops = rays @ np.linalg.inv(K).T @ EYE.rotation[2]
    distances = (height - EYE.position[2]) / drops
    frame = replace(frame, depth=distances if has_depth else None)
    detection = box_around(upper)
    result = measure_yaw(look_at(frame, detection), detection, upper_place, make_class(SQUARE, 4, QUARTER))
    assert (result is not None) == has_depth
    if result is not None:
        assert abs(result[0].angle - 0.3) < 2 * result[0].std


def test_the_place_of_an_object_with_a_grasp_point_is_the_middle_of_its_outline() -> None:
    pixels = find_pixels(WEDGE, 0.7)
    look = look_at(draw((pixels, RED)), box_around(pixels))
    wedge = make_class(WEDGE, 1)

    def find_error(part: ObjectClass) -> float:
        (observation,) = CellLocalizer("plane", {"part": part}, measures_yaw=True).localize(look)
        return math.dist(observation.position[:2], PLACE[:2])

    assert find_error(wedge) > 0.003
    assert find_error(replace(wedge, grasp_points=(GraspPoint((0.01, 0.0, 0.05)),))) < 0.001


def test_a_localizer_measures_yaws_of_confident_detections_if_the_tool_needs_them() -> None:
    pixels = find_pixels(SQUARE, 0.3)
    detection = box_around(pixels)
    look = look_at(draw((pixels, RED)), detection)
    classes = {"part": make_class(SQUARE, 4, QUARTER)}
    (without,) = CellLocalizer("plane", classes).localize(look)
    (measured,) = CellLocalizer("plane", classes, measures_yaw=True).localize(look)
    assert without.yaw is None
    assert measured.yaw is not None
    assert measured.yaw.angle == pytest.approx(0.3, abs=4 * measured.yaw.std)
    look = replace(look, confident=(), doubtful=(detection, replace(detection, label="boat")))
    assert [each.yaw for each in CellLocalizer("plane", classes, measures_yaw=True).localize(look)] == [
        None
    ] * 2
