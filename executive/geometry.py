"""Rigid transforms, rotations and quaternions.

Names follow the monogram notation: `X_WC` is the pose of coordinate frame C in frame W, with
`p_W = X_WC.apply(p_C)` and `X_WB = X_WA @ X_AB`. Quaternions are `(x, y, z, w)`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
GRAVITY = 9.81
"""Gravitational acceleration [m/s²]."""


@dataclass(frozen=True, eq=False)
class Pose:
    """A rigid transform, which consists of a rotation and a translation.

    Attributes:
        rotation: Rotation matrix `(3, 3)`.
        position: Translation `(3,)` [m].
    """

    rotation: Array
    position: Array

    @staticmethod
    def identity() -> Pose:
        """Return the identity transform."""
        return Pose(np.eye(3), np.zeros(3))

    @staticmethod
    def of(position: ArrayLike, quaternion: ArrayLike = (0.0, 0.0, 0.0, 1.0)) -> Pose:
        """Return the pose with a position `(3,)` [m] and the normalized quaternion `(x, y, z, w)`."""
        return Pose(rotation_from_quaternion(quaternion), np.asarray(position, dtype=float))

    def __matmul__(self, other: Pose) -> Pose:
        return Pose(self.rotation @ other.rotation, self.rotation @ other.position + self.position)

    def inverse(self) -> Pose:
        """Return the inverse transform."""
        return Pose(self.rotation.T, -self.rotation.T @ self.position)

    def apply(self, points: ArrayLike) -> Array:
        """Return points `(3,)` or `(N, 3)` [m] transformed by this pose: from C to W for `X_WC`."""
        return np.asarray(points, dtype=float) @ self.rotation.T + self.position

    @property
    def quaternion(self) -> Array:
        """The rotation as a unit quaternion `(x, y, z, w)` with `w >= 0`."""
        return quaternion_from_rotation(self.rotation)

    @property
    def rotation_vector(self) -> Array:
        """The rotation vector `(3,)`: axis times angle [rad], with an angle of at most pi; OpenCV's rvec."""
        # The import of scipy.spatial takes 0.3 s, and few runs need a rotation vector.
        from scipy.spatial.transform import Rotation

        return np.asarray(Rotation.from_matrix(self.rotation).as_rotvec())

    def to_rounded_list(self, digits: int = 6) -> list[float]:
        """Return position and quaternion as a list of seven rounded numbers."""
        return [round(float(value), digits) for value in (*self.position, *self.quaternion)]


def rotation_from_quaternion(quaternion: ArrayLike) -> Array:
    """Normalize a quaternion `(x, y, z, w)`, and return its rotation matrix `(3, 3)`."""
    x, y, z, w = np.asarray(quaternion, dtype=float) / np.linalg.norm(np.asarray(quaternion, dtype=float))
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_from_rotation(rotation: Array) -> Array:
    """Return the unit quaternion `(x, y, z, w)`, `w >= 0`, of a rotation matrix `(3, 3)`.

    Shepperd's method divides by the largest of the four components, so that it is numerically stable.
    """
    r = rotation
    squares = np.array([r[0, 0], r[1, 1], r[2, 2], r[0, 0] + r[1, 1] + r[2, 2]])
    largest = int(np.argmax(squares))
    if largest == 3:
        q = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], 1 + squares[3]])
    else:
        i, j, k = largest, (largest + 1) % 3, (largest + 2) % 3
        q = np.empty(4)
        q[i] = 1 + r[i, i] - r[j, j] - r[k, k]
        q[j] = r[j, i] + r[i, j]
        q[k] = r[k, i] + r[i, k]
        q[3] = r[k, j] - r[j, k]
    q /= np.linalg.norm(q)
    return q if q[3] >= 0 else -q


def rotate_about_z(angle: float) -> Array:
    """Return the rotation `(3, 3)` by `angle` [rad] about the z axis."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def make_tool_down_pose(position: ArrayLike, yaw: float = 0.0) -> Pose:
    """Return the tool pose `X_WT` at `position` `(3,)` [m] with the z axis of the tool vertically down.

    At `yaw` 0 [rad], the y axes of tool and world are parallel, and the x axis of the tool points in the
    negative x direction of the world: an iiwa has this orientation with elbow up and joint 7 near zero.
    """
    return Pose(rotate_about_z(yaw) @ np.diag([-1.0, 1.0, -1.0]), np.asarray(position, dtype=float))
