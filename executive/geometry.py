"""Rigid poses and the few constructions on them that everything else shares.

Names follow the monogram notation: `X_WC` is the pose of frame C in frame W, so that
`p_W = X_WC.apply(p_C)` and `X_WB = X_WA @ X_AB`. Quaternions are always `(x, y, z, w)`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
GRAVITY = 9.81
"""[m/s²]"""


@dataclass(frozen=True, eq=False)
class Pose:
    """A rigid transform: a rotation and a translation.

    Attributes:
        rotation: Rotation matrix `(3, 3)`.
        position: Translation `(3,)` [m].
    """

    rotation: Array
    position: Array

    @staticmethod
    def identity() -> Pose:
        """Return the transform that changes nothing."""
        return Pose(np.eye(3), np.zeros(3))

    @staticmethod
    def of(position: ArrayLike, quaternion: ArrayLike = (0.0, 0.0, 0.0, 1.0)) -> Pose:
        """Return the pose at `position` `(3,)` [m] turned by a unit `quaternion` `(x, y, z, w)`."""
        return Pose(rotation_from_quaternion(quaternion), np.asarray(position, dtype=float))

    def __matmul__(self, other: Pose) -> Pose:
        return Pose(self.rotation @ other.rotation, self.rotation @ other.position + self.position)

    def inverse(self) -> Pose:
        """Return the transform that undoes this one."""
        return Pose(self.rotation.T, -self.rotation.T @ self.position)

    def apply(self, points: ArrayLike) -> Array:
        """Return `points` `(3,)` or `(N, 3)` [m], given in the inner frame, in the outer one."""
        return np.asarray(points, dtype=float) @ self.rotation.T + self.position

    @property
    def quaternion(self) -> Array:
        """The rotation as a unit quaternion `(x, y, z, w)` with `w >= 0`."""
        return quaternion_from_rotation(self.rotation)

    @property
    def rotation_vector(self) -> Array:
        """The rotation as its axis `(3,)` times its angle [rad], the angle at most pi: OpenCV's rvec."""
        # Loading scipy.spatial takes a third of a second, and few runs need it.
        from scipy.spatial.transform import Rotation

        return np.asarray(Rotation.from_matrix(self.rotation).as_rotvec())

    def rounded(self, digits: int = 6) -> list[float]:
        """Return position and quaternion, rounded, as a plain list of seven numbers for records."""
        return [round(float(value), digits) for value in (*self.position, *self.quaternion)]


def rotation_from_quaternion(quaternion: ArrayLike) -> Array:
    """Return the rotation matrix `(3, 3)` of a unit quaternion `(x, y, z, w)`."""
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

    Shepperd's method: divides by the largest of the four components, so it is stable everywhere.
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


def about_z(angle: float) -> Array:
    """Return the rotation `(3, 3)` by `angle` [rad] about the z axis."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def tool_down(position: ArrayLike, yaw: float = 0.0) -> Pose:
    """Return the tool pose `X_WT` at `position` `(3,)` [m] whose z axis points straight down.

    At `yaw` 0 [rad] the tool's y axis is the world's and its x axis points backwards, the
    orientation an iiwa reaches with its natural elbow and joint 7 near zero.
    """
    return Pose(about_z(yaw) @ np.diag([-1.0, 1.0, -1.0]), np.asarray(position, dtype=float))
