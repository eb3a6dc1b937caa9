"""The pinhole camera, its OpenGL and OpenCV forms, and calibrations in a cell file."""

from __future__ import annotations

import math
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from executive.cell.device_config import CameraConfig
from executive.cell.frame import Frame
from executive.perception.camera_model import (
    NEAR_PLANE,
    compute_calibration,
    compute_camera_matrix,
    compute_look_at_pose,
    compute_pixel_ray,
    compute_projection_matrix,
    compute_view_matrix,
    intersect_plane,
    project,
)
from tests.camera_poses import looking_down

K = compute_camera_matrix(640, 480, 55)
GIVEN = [461.0, 0, 310.0, 0, 470.0, 250.0, 0, 0, 1]
coordinate = st.floats(-0.4, 0.4)
cameras = st.builds(
    lambda x, y, z, *target: compute_look_at_pose([x, y, z], [*target, 0.0], (1.0, 0.1, 0.0)),
    *(coordinate, coordinate, st.floats(0.5, 1.5), coordinate, coordinate),
)
points = st.builds(lambda *point: np.array(point), coordinate, coordinate, st.floats(0.0, 0.2))
matrices = st.builds(
    lambda fx, fy, cx, cy: np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]]),
    *(st.floats(300, 900), st.floats(300, 900), st.floats(250, 390), st.floats(180, 300)),
)


def test_the_field_of_view_is_vertical_and_the_principal_point_in_the_middle():
    edge = 1.2 * math.tan(math.radians(27.5))
    X_WC = looking_down([0, 0, 1.2])
    assert project(K, X_WC, [0, 0, 0]) == pytest.approx([320, 240])
    assert project(K, X_WC, [edge, 0, 0]) == pytest.approx([320, 0])
    assert project(K, X_WC, [0, -edge, 0])[0] > 480


@given(cameras, points)
def test_a_point_is_found_again_on_the_plane_it_lies_in(X_WC, point):
    pixel = project(K, X_WC, point)
    assert intersect_plane(K, X_WC, pixel, point[2]) == pytest.approx(point, abs=1e-9)
    towards = point - X_WC.position
    # A point behind the camera has a pixel too, on the way to the other side.
    towards *= np.sign(X_WC.inverse().apply(point)[2])
    ray = compute_pixel_ray(K, X_WC, pixel)
    assert ray / np.linalg.norm(ray) == pytest.approx(towards / np.linalg.norm(towards), abs=1e-9)
    assert X_WC.rotation[:, 2] @ ray == pytest.approx(1.0)


@given(cameras, points)
def test_opengl_matrices_draw_a_point_where_it_is_projected(X_WC, point):
    assume(X_WC.inverse().apply(point)[2] > NEAR_PLANE)
    left, top, right, bottom = part = (100.0, 50.0, 356.0, 306.0)
    view = np.array(compute_view_matrix(X_WC)).reshape(4, 4).T
    clip = np.array(compute_projection_matrix(K, part)).reshape(4, 4).T @ view @ [*point, 1.0]
    ndc = clip[:3] / clip[3]
    drawn = (left + (ndc[0] + 1) / 2 * (right - left), top + (1 - ndc[1]) / 2 * (bottom - top))
    assert drawn == pytest.approx(project(K, X_WC, point), abs=1e-6)
    assert -1 < ndc[2] < 1


@given(matrices, cameras, points)
def test_opencv_projects_where_we_do_half_a_pixel_aside_and_its_camera_is_ours(matrix, X_WC, point):
    theirs, rvec, tvec = Frame.to_opencv(SimpleNamespace(matrix=matrix, X_WC=X_WC))
    (((u, v),),), _ = cv2.projectPoints(point[None], rvec, tvec, theirs, None)
    assert (u + 0.5, v + 0.5) == pytest.approx(project(matrix, X_WC, point), abs=1e-6)
    pose = {"rotation": rvec, "translation": tvec}
    back, X_WB = compute_calibration(by_calibration(matrix=theirs.ravel(), mount_to_camera=pose))
    assert back == pytest.approx(matrix)
    assert X_WB.rotation == pytest.approx(X_WC.rotation, abs=1e-9)
    assert X_WB.position == pytest.approx(X_WC.position, abs=1e-9)


KEPT = {"mount": "fixed", "table_view": (192, 100, 448, 356), "scan_poses": ("home",)}


def by_calibration(**calibration):
    """Return a camera with a calibration."""
    return CameraConfig(**KEPT, calibration=calibration)


def test_a_hand_eye_calibration_is_the_way_back():
    there = {"rotation": [0.3, -0.2, 1.1], "translation": [0.1, 0.2, 0.3]}
    _, X_MC = compute_calibration(by_calibration(matrix=GIVEN, camera_to_mount=there))
    _, X_CM = compute_calibration(by_calibration(matrix=GIVEN, mount_to_camera=there))
    assert X_MC.position == pytest.approx([0.1, 0.2, 0.3])
    assert X_MC.rotation == pytest.approx(cv2.Rodrigues(np.array([0.3, -0.2, 1.1]))[0])
    assert (X_MC @ X_CM).rotation == pytest.approx(np.eye(3))
