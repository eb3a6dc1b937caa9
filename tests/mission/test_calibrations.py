"""Calibrations in a cell file, in the forms of OpenCV and ROS."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from executive.cell.device_config import CameraConfig
from executive.mission.cell_file import load_cell
from executive.perception.camera_model import compute_calibration, find_calibration_doubts
from executive.text.findings import MissionError

K = "[461, 0, 319.5, 0, 461, 239.5, 0, 0, 1]"
NINE = f"matrix: {K}"
FLIP = "rotation: [2.2214415, -2.2214415, 0]"
T = "[0, 0.5, 1.2]"
POSE = f"{{{FLIP}, translation: {T}}}"
R = "[0, -1, 0, -1, 0, 0, 0, 0, -1]"
CAMERA_INFO = f"""\
image_width: 640
image_height: 480
camera_matrix: {{rows: 3, cols: 3, data: {K}}}
distortion_model: plumb_bob
distortion_coefficients: {{rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}}
projection_matrix: {{rows: 3, cols: 4, data: [461, 0, 319.5, 0, 0, 461, 239.5, 0, 0, 0, 1, 0]}}
"""


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def read(matrix: str = NINE, pose: str = POSE) -> CameraConfig:
    """Return a camera with a calibration; the matrix is in line 8 and the pose in line 9."""
    Path("c.yaml").write_text(
        "base: overhead.yaml\ncell: c\ncameras:\n  top:\n    mount: fixed\n    scan_poses: [home]\n"
        f"    calibration:\n      {matrix}\n      mount_to_camera: {pose}\n"
        "    table_view: [192, 100, 448, 356]\n"
    )
    return load_cell(Path("c.yaml")).cameras["top"]


def is_expected(camera: CameraConfig) -> bool:
    """Return True if a camera has the matrix `K`, and the pose `POSE`."""
    matrix, X_WC = compute_calibration(camera)
    values = [*matrix[[0, 1], [0, 1]], *matrix[:2, 2], *X_WC.position, *X_WC.rotation.ravel()]
    return np.allclose(values, [461, 461, 320, 240, 0.5, 0, 1.2, 0, -1, 0, -1, 0, 0, 0, 0, -1], atol=1e-6)


@pytest.mark.parametrize(
    ("matrix", "pose"),
    [
        (NINE, POSE),
        ("matrix: [[461, 0, 319.5], [0, 461, 239.5], [0, 0, 1]]", f"{{rotation: {R}, translation: {T}}}"),
        (f"matrix: {{rows: 3, data: {K}}}", f"{{rotation: {{data: {R}}}, translation: {{data: {T}}}}}"),
        (NINE, "{rotation: [[0, -1, 0], [-1, 0, 0], [0, 0, -1]], translation: [[0], [0.5], [1.2]]}"),
        (NINE, f"{{quaternion_xyzw: [0.7072, -0.7072, 0, 0], translation: {T}}}"),
        (NINE, f"{{quaternion_wxyz: [0, 0.7072, -0.7072, 0], translation: {T}}}"),
    ],
)  # fmt: skip
def test_every_form_of_a_calibration_is_the_same_camera_in_records(matrix: str, pose: str) -> None:
    record = read(matrix, pose).model_dump(mode="json")
    assert is_expected(CameraConfig.model_validate(record))


@pytest.mark.parametrize(
    ("matrix", "rotation", "expected"),
    [
        ("matrix: [461, 0, 319.5, 0, 461, x, 0, 0, 1]", FLIP, "c.yaml:8:39: error[wrong-type]"),
        ("matrix: [[461, 0, 319.5], [0, 461, x], [0, 0, 1]]", FLIP, "c.yaml:8:42: error[wrong-type]"),
        ("matrix: [461, 0, 0, 0, 461, 0, 319.5, 239.5, 1]", FLIP, "neither transposed"),
        ("file: nothing.yaml", FLIP, "c.yaml:8:13: error[no-calibration]"),
        ("file: c.yaml", FLIP, "camera_matrix or K"),
        ("file: cycle.yaml", FLIP, "cycle.yaml:1:1: error[wrong-type]"),
        (f"{NINE}\n      width: 1280\n      height: 960", FLIP, "for 1280 x 960"),
        (NINE, "rotation: [0.7, -0.7, 0, 0]", "quaternion_xyzw or quaternion_wxyz"),
        (NINE, "quaternion_wxyz: [0, 0.9, -0.9, 0]", "norms of rows: 1.273"),
        (NINE, "rotation: [0, -1, 0, -1, 0, 0, 0, 0, 1]", "determinant: -1"),
        (NINE, "rotation: [0.9, -0.5, 0, 0.5, 0.9, 0, 0, 0, 1]", "up to 0.06"),
        (NINE, "rotation: [180, 0, 0]", "c.yaml:9:36: error[out-of-range]"),
        (NINE, "rotation: [0, 0, 0], quaternion_wxyz: [1, 0, 0, 0]", "needs exactly one of rotation"),
    ],
)
def test_a_wrong_calibration_is_refused_at_its_place(matrix: str, rotation: str, expected: str) -> None:
    Path("cycle.yaml").write_text("camera_matrix: {file: cycle.yaml}\n")
    with pytest.raises(MissionError, match=re.escape(expected)):
        read(matrix, f"{{{rotation}, translation: {T}}}")


@pytest.mark.parametrize(
    "text",
    [
        CAMERA_INFO,
        f"height: 480\nwidth: 640\nd: [0, 0, 0, 0, 0]\nk: {K}\n---\n",
        f"\ufeffK: {K}\r\n",
        f"%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: {K}\n",
        f"%YAML 1.2\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: {K}\n",
    ],
)
def test_a_file_of_ros_or_opencv_is_read(text: str) -> None:
    Path("camera.yaml").write_text(text, newline="")
    assert is_expected(read("file: camera.yaml"))


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("plumb_bob", "equidistant", "info.yaml:4:19: error[wrong-value]"),
        ("319.5, 0", "319.5, o", "info.yaml:3:57: error[wrong-type]"),
        ("640", "1280", "for 1280 x 480"),
    ],
)
def test_an_error_in_a_file_is_found_in_the_file(old: str, new: str, expected: str) -> None:
    Path("info.yaml").write_text(CAMERA_INFO.replace(old, new, 1))
    with pytest.raises(MissionError, match=re.escape(expected)):
        read("file: info.yaml")


def test_distortion_is_doubtful() -> None:
    camera = read(f"{NINE}\n      distortion: [[-0.3, 0.1, 0, 0, 0]]")
    assert [key for key, _ in find_calibration_doubts(camera)] == ["distortion"]
