"""Pinhole camera model: projection of points into an image, and rays through its pixels.

Camera frames follow OpenCV (z along the optical axis, x to the right, y down). Image coordinates are
continuous: pixel i covers [i, i + 1), so the principal point of a centred camera is (W / 2, H / 2).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from executive.cell.config import CameraConfig
from executive.cell.frame import Box
from executive.geometry import Array, Pose

NEAR, FAR = 0.02, 5.0
"""Clipping planes of rendered cameras [m]."""


def compute_camera_matrix(width: int, height: int, fov_deg: float) -> Array:
    """Return the camera matrix `(3, 3)` [pixel] of a centred camera with square pixels.

    Args:
        width: Image width [pixel].
        height: Image height [pixel].
        fov_deg: Vertical field of view [degree].
    """
    focal = height / 2 / math.tan(math.radians(fov_deg) / 2)
    return np.array([[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]])


def compute_field_of_view(matrix: Array, height: int) -> float:
    """Return the vertical field of view [degree] of a camera matrix `(3, 3)` and an image height [pixel]."""
    return 2 * math.degrees(math.atan(height / 2 / float(matrix[1, 1])))


def compute_look_at_pose(position: ArrayLike, target: ArrayLike, up: ArrayLike) -> Pose:
    """Return the pose of a camera at `position` whose optical axis passes through `target`.

    `up` `(3,)` is the direction towards the top of the image; it need not be perpendicular to the axis.

    Raises:
        ValueError: The three arguments do not determine a pose.
    """
    origin = np.asarray(position, dtype=float)
    axis = np.asarray(target, dtype=float) - origin
    right = np.cross(axis, np.asarray(up, dtype=float))
    if np.linalg.norm(right) < 1e-9:
        raise ValueError(
            f"a camera at {origin.tolist()} with axis {axis.tolist()} cannot have "
            f"{np.asarray(up, dtype=float).tolist()} as its upward direction: "
            "look_at must differ from position, and up must not lie along the axis"
        )
    z = axis / np.linalg.norm(axis)
    x = right / np.linalg.norm(right)
    return Pose(np.column_stack([x, np.cross(z, x), z]), origin)


def convert_from_opencv(matrix: ArrayLike, rvec: ArrayLike, tvec: ArrayLike) -> tuple[Array, Pose]:
    """Return camera matrix `(3, 3)` [pixel] and pose `X_WC` of a camera calibrated with OpenCV.

    The inverse of `Frame.to_opencv`. Pixel centres have integer coordinates in OpenCV, and are half a pixel
    further here; rvec [rad] and tvec [m] of `cv2.solvePnP` transform points from W to C.
    """
    # The import takes a third of a second, and few cells have a camera calibrated with OpenCV.
    from scipy.spatial.transform import Rotation

    shifted = np.array(matrix, dtype=float)
    shifted[:2, 2] += 0.5
    X_CW = Pose(Rotation.from_rotvec(rvec).as_matrix(), np.asarray(tvec, dtype=float))
    return shifted, X_CW.inverse()


def compute_calibration(config: CameraConfig) -> tuple[Array, Pose]:
    """Return the camera matrix `(3, 3)` [pixel] and the pose `X_MC` of a camera in a cell file.

    Frame M is the world for a fixed camera, and the flange for a wrist camera.
    """
    calibration = config.calibration
    if calibration is None:
        assert config.position and config.look_at and config.up and config.fov_deg, "checked by CameraConfig"
        matrix = compute_camera_matrix(config.width, config.height, config.fov_deg)
        return matrix, compute_look_at_pose(config.position, config.look_at, config.up)
    transform = calibration.mount_to_camera or calibration.camera_to_mount
    assert transform is not None, "checked by CalibrationConfig"
    matrix, X_MC = convert_from_opencv(calibration.matrix, transform.rotation, transform.translation)
    return matrix, X_MC if calibration.mount_to_camera else X_MC.inverse()


def project(matrix: Array, X_WC: Pose, points: ArrayLike) -> Array:
    """Return the image coordinates `(..., 2)` [pixel] of points `(..., 3)` [m] in the world.

    The points must lie in front of the camera.
    """
    p = X_WC.inverse().apply(points) @ matrix.T
    return np.asarray(p[..., :2] / p[..., 2:])


def compute_pixel_ray(matrix: Array, X_WC: Pose, pixel: ArrayLike) -> Array:
    """Return the unit vector `(3,)` in the world along the ray through `pixel` `(2,)`."""
    u, v = np.asarray(pixel, dtype=float)
    direction = X_WC.rotation @ np.linalg.solve(matrix, np.array([u, v, 1.0]))
    return np.asarray(direction / np.linalg.norm(direction))


def intersect_plane(matrix: Array, X_WC: Pose, pixel: ArrayLike, z: float) -> Array:
    """Return the point `(3,)` [m] at height `z` [m] in the world that appears at `pixel` `(2,)`.

    Raises:
        ValueError: The ray through the pixel does not meet that height in front of the camera.
    """
    u, v = np.asarray(pixel, dtype=float)
    direction = X_WC.rotation @ np.linalg.solve(matrix, np.array([u, v, 1.0]))
    drop = z - X_WC.position[2]
    if abs(direction[2]) < 1e-9 or drop / direction[2] <= 0:
        raise ValueError(
            f"pixel {np.asarray(pixel, dtype=float).tolist()} of a camera {X_WC.position[2]:.3f} m high "
            f"looks away from the plane z = {z:.3f} m; only pixels whose ray meets it can be placed on it"
        )
    return np.asarray(X_WC.position + drop / direction[2] * direction)


def compute_view_matrix(X_WC: Pose) -> tuple[float, ...]:
    """Return the view matrix of OpenGL and PyBullet: 16 numbers, column by column."""
    X_CW = X_WC.inverse()
    view = np.eye(4)
    view[:3, :3], view[:3, 3] = X_CW.rotation, X_CW.position
    return tuple((np.diag([1.0, -1.0, -1.0, 1.0]) @ view).T.ravel().tolist())


def compute_projection_matrix(
    matrix: Array, part: Box, near: float = NEAR, far: float = FAR
) -> tuple[float, ...]:
    """Return OpenGL's projection matrix of a part of an image: 16 numbers, column by column.

    A renderer with this matrix draws `part` (left, top, right, bottom [pixel]) of the camera's image; the
    pixels are those of the full image. `near` and `far` are the clipping planes [m].
    """
    (left, top), (right, bottom) = (
        ((x - matrix[0, 2]) / matrix[0, 0] * near, (matrix[1, 2] - y) / matrix[1, 1] * near)
        for x, y in (part[:2], part[2:])
    )
    projection = np.array(
        [
            [2 * near / (right - left), 0.0, (right + left) / (right - left), 0.0],
            [0.0, 2 * near / (top - bottom), (top + bottom) / (top - bottom), 0.0],
            [0.0, 0.0, -(far + near) / (far - near), -2 * far * near / (far - near)],
            [0.0, 0.0, -1.0, 0.0],
        ]
    )
    return tuple(projection.T.ravel().tolist())
