"""Displaced cameras are found by the outlines of the bins, in images drawn without the simulator."""

from __future__ import annotations

import re
from dataclasses import replace

import cv2
import numpy as np
import pytest

from executive.cell.config import BinConfig
from executive.cell.frame import BinAppearance, Frame
from executive.cell.objects import BIN_THICKNESS, Bin
from executive.geometry import Array, Pose
from executive.perception.bin_check import inspect_bins
from executive.perception.camera_check import (
    MAX_OUTLINE_DISTANCE,
    describe_displacement,
    describe_standstill,
    estimate_offset,
)
from executive.perception.camera_model import compute_camera_matrix, project
from tests.camera_poses import looking_down

MATRIX = compute_camera_matrix(640, 480, 55.0)
DECLARED = looking_down([0.5, 0.0, 1.2])
COLOURS = {"red": (190, 40, 40), "blue": (40, 60, 190), "yellow": (215, 190, 40)}
PLACES = {"red": (0.24, -0.48, 0.0), "blue": (0.24, 0.48, 0.0), "yellow": (0.49, 0.46, 0.0)}
BINS = [
    BinConfig(position=place, size=(0.24, 0.30, 0.06), colour=(1.0, 1.0, 1.0), slots=(1, 1)).build_bin(name)
    for name, place in PLACES.items()
]
DECLARED_BINS = [replace(bin, colour=tuple(np.array(COLOURS[bin.name]) / 255)) for bin in BINS]


def draw(X_WC: Pose, *, light: float = 1.0, bins: list[Bin] = BINS, matrix: Array = MATRIX) -> Frame:
    """Return a noisy frame of bins on a table from `X_WC` that claims to be taken from `DECLARED`."""
    image = np.full((480, 640, 3), (190, 165, 130), dtype=np.float32)
    for bin in bins:
        colour = np.array(COLOURS[bin.name], dtype=float)
        x, y = bin.size[:2] / 2 + BIN_THICKNESS
        base = np.array([(-x, -y, 0), (-x, y, 0), (x, y, 0), (x, -y, 0)])
        rim, height = base + np.array([0, 0, bin.size[2]]), bin.size[2]
        inner = np.array([1 - 2 * BIN_THICKNESS / bin.size[0], 1 - 2 * BIN_THICKNESS / bin.size[1], 1])
        hull = cv2.convexHull(find_pixels(X_WC, bin, np.concatenate([base, rim]), matrix))[:, 0]
        opening = find_pixels(X_WC, bin, rim * inner, matrix)
        floor = find_pixels(X_WC, bin, rim * inner - (0, 0, height - BIN_THICKNESS), matrix)
        fill(image, hull, 0.6 * colour)
        fill(image, find_pixels(X_WC, bin, rim, matrix), 0.95 * colour)
        fill(image, opening, 0.7 * colour)
        # The walls hide the rest of the floor.
        fill(image, cv2.intersectConvexConvex(opening, floor)[1][:, 0], 0.95 * colour)
    noise = np.random.default_rng(1).normal(0, 2, image.shape)
    shown = np.clip(light * image + noise, 0, 255).astype(np.uint8)
    return Frame(1, "top", shown, None, MATRIX, DECLARED, 0.0, np.ones((480, 640), np.bool_), 0)


def find_pixels(X_WC: Pose, bin: Bin, corners: Array, matrix: Array) -> np.ndarray:
    """Return OpenCV's pixels of corners `(N, 3)` [m] in the frame of a bin."""
    return (project(matrix, X_WC, corners + bin.position) - 0.5).astype(np.float32)


def fill(image: np.ndarray, polygon: np.ndarray, colour: Array) -> None:
    """Fill a convex polygon to a sixteenth of a pixel."""
    cv2.fillConvexPoly(image, np.round(16 * polygon).astype(np.int32), colour.tolist(), cv2.LINE_8, 4)


def move(
    shift: tuple[float, float, float] = (0, 0, 0), turn_deg: tuple[float, float, float] = (0, 0, 0)
) -> Pose:
    """Return the declared pose, shifted in the world [m] and turned about the camera's axes [degree]."""
    turn = Pose(np.asarray(cv2.Rodrigues(np.radians(turn_deg))[0]), np.zeros(3))
    return Pose.of(shift) @ DECLARED @ turn


@pytest.mark.parametrize("light", [1.0, 0.15])
def test_a_camera_in_its_place_is_believed_to_be_there(light: float) -> None:
    frame = draw(DECLARED, light=light)
    offset = estimate_offset(frame, BINS)
    assert offset is not None
    assert offset.outline_distance < MAX_OUTLINE_DISTANCE / 3
    assert describe_displacement(frame, BINS) == ""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shift", "turn_deg"),
    [
        ((0.01, 0.0, 0.0), (0, 0, 0)), ((0.03, 0.04, 0.0), (0, 0, 0)), ((0.0, 0.0, -0.12), (0, 0, 0)),
        ((0, 0, 0), (2, 0, 0)), ((0, 0, 0), (0, -6, 0)), ((0, 0, 0), (0, 0, -10)), ((0, 0, 0), (5, 5, 3)),
    ],
)  # fmt: skip
def test_a_shift_and_a_rotation_are_measured(shift, turn_deg) -> None:
    offset = estimate_offset(draw(move(shift, turn_deg)), BINS)
    assert offset is not None and offset.outline_distance > MAX_OUTLINE_DISTANCE
    assert offset.rotation_deg == pytest.approx(np.linalg.norm(turn_deg), abs=1.0)
    if turn_deg == (0, 0, 0):
        assert offset.shift == pytest.approx(shift, abs=0.015)


def test_the_words_say_where_the_bins_are_and_how_the_camera_has_moved() -> None:
    words = describe_displacement(draw(move((0.0, -0.03, 0.0))), BINS)
    assert re.search(
        r"camera top .* outlines of red, blue, yellow appear (29|30|31) mm away.* had moved by "
        r"\(\S+, -[23]\d, \S+\) mm and turned by 0\.\d degrees; limit 5 mm",
        words,
    )


def test_a_bin_that_somebody_moved_is_no_moved_camera() -> None:
    away = Bin("yellow", BINS[2].position + np.array([0.05, -0.04, 0.0]), BINS[2].size, BINS[2].slots)
    assert describe_displacement(draw(DECLARED, bins=[*BINS[:2], away]), BINS) == ""


@pytest.mark.parametrize(("light", "hidden_width"), [(0.0, 0), (0.005, 0), (1.0, 560), (1.0, 640)])
def test_darkness_a_straight_line_and_an_arm_do_not_say_where_a_camera_is(
    light: float, hidden_width: int
) -> None:
    frame = draw(move((0.03, 0.0, 0.0)), light=light)
    frame.visible[:, :hidden_width] = False
    assert estimate_offset(frame, BINS) is None


def find_contradictions(frame: Frame) -> dict[str, str | None]:
    appearances = inspect_bins(frame, DECLARED_BINS)
    return {name: appearances.get(name, BinAppearance()).contradiction for name in PLACES}


def test_only_the_bin_that_was_moved_contradicts_and_the_words_say_how_far() -> None:
    away = Bin("yellow", BINS[2].position + np.array([0.05, -0.08, 0.0]), BINS[2].size, BINS[2].slots)
    found = find_contradictions(draw(DECLARED, bins=[*BINS[:2], away]))
    assert (found["red"], found["blue"]) == ("", "")
    assert re.search(
        r"yellow is not at its declared place: .* is \(\+(4|5)\d, -(7|8)\d\) mm away", found["yellow"]
    )


def test_a_bin_that_is_gone_has_no_other_place() -> None:
    found = find_contradictions(draw(DECLARED, bins=BINS[1:]))
    assert "no outline of its size is near by" in (found["red"] or "")


def test_exchanged_bins_have_the_colours_of_each_other() -> None:
    exchanged = [replace(BINS[0], name="blue"), replace(BINS[1], name="red"), BINS[2]]
    found = find_contradictions(draw(DECLARED, bins=exchanged, light=0.6))
    assert "has the colour of blue" in found["red"]
    assert "has the colour of red" in found["blue"]
    assert found["yellow"] == ""


def test_the_arm_and_darkness_are_no_evidence_about_bins() -> None:
    frame = draw(DECLARED, bins=BINS[:2])
    frame.visible[:300] = False
    assert find_contradictions(frame)["yellow"] is None
    assert set(find_contradictions(draw(DECLARED, bins=BINS[:2], light=0.15)).values()) == {None}


@pytest.mark.parametrize(
    ("seed", "arm_colour", "problem"),
    [
        (0, None, "has the same pixels as frame 1"),
        (1, None, "differs from frame 1 in 0.0% of the region"),
        (1, (240, 120, 20), ""),
    ],
)
def test_a_camera_is_frozen_if_its_image_does_not_change_where_the_arm_moved(
    seed: int, arm_colour: tuple[int, int, int] | None, problem: str
) -> None:
    first = draw(DECLARED)
    image = first.image.copy()
    visible = first.visible.copy()
    visible[200:320, 200:320] = False
    if arm_colour:
        image[220:300, 220:300] = arm_colour
    noise = seed * np.random.default_rng(seed).normal(0, 2, image.shape)
    noisy = np.clip(image + noise, 0, 255).astype(np.uint8)
    second = replace(first, id=2, stamp=0.5, image=noisy, visible=visible)
    text = describe_standstill(second, first)
    assert problem in text if problem else text == ""


def test_an_object_on_the_floor_of_a_bin_in_view_is_measured() -> None:
    frame = draw(DECLARED)
    assert {appearance[1:] for appearance in inspect_bins(frame, DECLARED_BINS).values()} == {(0.0, True)}
    column, row = project(MATRIX, DECLARED, [PLACES["red"]])[0].astype(int)
    frame.image[row - 10 : row + 10, column - 10 : column + 10] = 20
    _, area, is_whole = inspect_bins(frame, DECLARED_BINS)["red"]
    assert (area, is_whole) == (pytest.approx((20 * 1.2 / MATRIX[0, 0]) ** 2, rel=0.15), True)
    frame.visible[row + 20 :] = False
    assert not inspect_bins(frame, DECLARED_BINS)["red"].is_whole
