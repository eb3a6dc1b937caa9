from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from executive.cell_config import CameraConfig
from executive.geometry import Pose, looking_down
from executive.messages import Frame
from executive.vision.camera_model import (
    calibrated,
    camera_matrix,
    from_opencv,
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


def frame(matrix: np.ndarray, X_WC: Pose) -> Frame:
    nothing = np.zeros((480, 640), np.bool_)
    image = np.zeros((480, 640, 3), np.uint8)
    return Frame(1, "eye", image, None, matrix, X_WC, 0.0, nothing, 0)


matrices = st.builds(
    lambda fx, fy, cx, cy: np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]]),
    *(st.floats(300, 900), st.floats(300, 900), st.floats(250, 390), st.floats(180, 300)),
)


@given(matrices, cameras(), coordinate, coordinate, st.floats(0.0, 0.2))
def test_opencv_projects_where_we_do_half_a_pixel_aside(
    matrix: np.ndarray, X_WC: Pose, x: float, y: float, z: float
) -> None:
    theirs, rvec, tvec = frame(matrix, X_WC).opencv()
    (((u, v),),), _ = cv2.projectPoints(np.array([[x, y, z]]), rvec, tvec, theirs, None)
    assert (u + 0.5, v + 0.5) == pytest.approx(project(matrix, X_WC, [x, y, z]), abs=1e-6)


@given(matrices, cameras())
def test_a_camera_comes_back_from_opencv(matrix: np.ndarray, X_WC: Pose) -> None:
    back, X_WB = from_opencv(*frame(matrix, X_WC).opencv())
    assert back == pytest.approx(matrix)
    assert X_WB.rotation == pytest.approx(X_WC.rotation, abs=1e-9)
    assert X_WB.position == pytest.approx(X_WC.position, abs=1e-9)


def test_solve_pnp_finds_the_calibration_of_a_camera(camera: CameraConfig) -> None:
    _, X_WC = calibrated(camera)
    marks = np.random.default_rng(1).uniform((0.3, -0.3, 0.0), (0.7, 0.3, 0.2), (20, 3))
    given_matrix = [[461.0, 0, 310.0], [0, 470.0, 250.0], [0, 0, 1]]
    seen = project(from_opencv(given_matrix, np.zeros(3), np.zeros(3))[0], X_WC, marks) - 0.5
    _, rvec, tvec = cv2.solvePnP(marks, seen, np.array(given_matrix), None)
    measured = {
        "matrix": given_matrix,
        "mount_to_camera": {"rotation": rvec.ravel().tolist(), "translation": tvec.ravel().tolist()},
    }
    found_matrix, found = calibrated(by_calibration(camera, measured))
    assert found.rotation == pytest.approx(X_WC.rotation, abs=1e-5)
    assert found.position == pytest.approx(X_WC.position, abs=1e-5)
    assert project(found_matrix, found, marks) == pytest.approx(seen + 0.5, abs=1e-3)


def test_a_hand_eye_calibration_is_the_way_back(camera: CameraConfig) -> None:
    matrix = [[461.0, 0, 310.0], [0, 470.0, 250.0], [0, 0, 1]]
    there = {"rotation": [0.3, -0.2, 1.1], "translation": [0.1, 0.2, 0.3]}
    _, X_MC = calibrated(by_calibration(camera, {"matrix": matrix, "camera_to_mount": there}))
    _, X_CM = calibrated(by_calibration(camera, {"matrix": matrix, "mount_to_camera": there}))
    assert X_MC.position == pytest.approx([0.1, 0.2, 0.3])
    assert X_MC.rotation == pytest.approx(cv2.Rodrigues(np.array([0.3, -0.2, 1.1]))[0])
    assert (X_MC @ X_CM).rotation == pytest.approx(np.eye(3))


@pytest.fixture
def camera() -> CameraConfig:
    return CameraConfig(
        mount="fixed", position=(0.5, 0.1, 1.2), look_at=(0.45, 0, 0), up=(1, 0, 0), fov_deg=55,
        table_view=(192, 100, 448, 356), scan_poses=("home",),
    )  # fmt: skip


def by_calibration(camera: CameraConfig, calibration: dict[str, object]) -> CameraConfig:
    """Return the camera with a calibration instead of what says where it is."""
    keys = {"mount", "table_view", "scan_poses"}
    return CameraConfig(**{**camera.model_dump(include=keys), "calibration": calibration})


TURN = {"rotation": [0, 0, 0], "translation": [0, 0, 1]}
MATRIX = [[400, 0, 320], [0, 400, 240], [0, 0, 1]]


@pytest.mark.parametrize(
    ("calibration", "expected"),
    [
        ({"matrix": MATRIX}, "needs either mount_to_camera or camera_to_mount"),
        (
            {"matrix": MATRIX, "mount_to_camera": TURN, "camera_to_mount": TURN},
            "needs either mount_to_camera or camera_to_mount, the one being the other's inverse",
        ),
        (
            {"matrix": [[400, 2, 320], [0, 400, 240], [0, 0, 1]], "mount_to_camera": TURN},
            r"needs a matrix \[\[fx, 0, cx\], \[0, fy, cy\], \[0, 0, 1\]\] with fx and fy above 0, "
            r"not \[\[400.0, 2.0, 320.0\]",
        ),
    ],
)
def test_a_calibration_that_is_none_is_refused(
    camera: CameraConfig, calibration: dict[str, object], expected: str
) -> None:
    with pytest.raises(ValueError, match=expected):
        by_calibration(camera, calibration)


def test_a_camera_says_either_way_where_it_is(camera: CameraConfig) -> None:
    plain = camera.model_dump(exclude_none=True)
    both = {**plain, "calibration": {"matrix": MATRIX, "mount_to_camera": TURN}}
    with pytest.raises(ValueError, match="needs no position, look_at, up, fov_deg where it has"):
        CameraConfig(**both)
    del plain["up"], plain["fov_deg"]
    with pytest.raises(
        ValueError, match="needs up, fov_deg, or a calibration instead of position, look_at, up, fov_deg"
    ):
        CameraConfig(**plain)
