from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from executive.geometry import Pose, looking_down
from executive.vision.camera_model import (
    camera_matrix,
    looking_at,
    on_plane,
    pixel_ray,
    project,
    projection_matrix,
    view_matrix,
)

K = camera_matrix(640, 480, 55)
coordinate = st.floats(-0.4, 0.4)


@st.composite
def cameras(draw: st.DrawFn) -> Pose:
    position = np.array([draw(coordinate), draw(coordinate), draw(st.floats(0.5, 1.5))])
    target = np.array([draw(coordinate), draw(coordinate), 0.0])
    return looking_at(position, target, (1.0, 0.1, 0.0))


def test_the_field_of_view_is_vertical_and_the_principal_point_in_the_middle() -> None:
    edge = 1.2 * math.tan(math.radians(27.5))
    X_WC = looking_down([0, 0, 1.2])
    assert project(K, X_WC, [0, 0, 0]) == pytest.approx([320, 240])
    assert project(K, X_WC, [edge, 0, 0]) == pytest.approx([320, 0])
    assert project(K, X_WC, [0, -edge, 0])[0] > 480


def test_looking_straight_down_agrees_with_looking_at_a_point_below() -> None:
    down = looking_at([0.5, 0.1, 1.2], [0.5, 0.1, 0.0], [1, 0, 0])
    assert down.rotation == pytest.approx(looking_down([0.5, 0.1, 1.2]).rotation)


@given(cameras(), coordinate, coordinate, st.floats(0.0, 0.2))
def test_a_point_is_found_again_on_the_plane_it_lies_in(X_WC: Pose, x: float, y: float, z: float) -> None:
    pixel = project(K, X_WC, [x, y, z])
    assert on_plane(K, X_WC, pixel, z) == pytest.approx([x, y, z], abs=1e-9)
    towards = np.array([x, y, z]) - X_WC.position
    assert pixel_ray(K, X_WC, pixel) == pytest.approx(towards / np.linalg.norm(towards), abs=1e-9)


@given(cameras(), coordinate, coordinate)
def test_opengl_matrices_draw_a_point_where_it_is_projected(X_WC: Pose, x: float, y: float) -> None:
    left, top, right, bottom = part = (100.0, 50.0, 356.0, 306.0)
    view = np.array(view_matrix(X_WC)).reshape(4, 4).T
    clip = np.array(projection_matrix(K, part)).reshape(4, 4).T @ view @ np.array([x, y, 0.0, 1.0])
    ndc = clip[:3] / clip[3]
    drawn = (left + (ndc[0] + 1) / 2 * (right - left), top + (1 - ndc[1]) / 2 * (bottom - top))
    assert drawn == pytest.approx(project(K, X_WC, [x, y, 0.0]), abs=1e-6)
    assert -1 < ndc[2] < 1


def test_a_ray_that_misses_the_plane_says_so() -> None:
    with pytest.raises(ValueError, match=r"1\.200 m high looks away from the plane z = 2\.000 m"):
        on_plane(K, looking_down([0, 0, 1.2]), (320, 240), 2.0)


def test_an_upward_direction_along_the_axis_is_refused() -> None:
    with pytest.raises(ValueError, match="up must not lie along the axis"):
        looking_at([0, 0, 1], [0, 0, 0], [0, 0, 1])
