"""Rigid transforms, rotations and quaternions.

Names follow the monogram notation: `X_WC` is the pose of coordinate frame C in frame W, with
`p_W = X_WC.apply(p_C)` and `X_WB = X_WA @ X_AB`. Quaternions are `(x, y, z, w)`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
"""NumPy array of floats; docstrings state the shape."""
GRAVITY = 9.81
"""Gravitational acceleration [m/s²]."""


class Yaw(NamedTuple):
    """Measured angle of an object about the vertical axis.

    Attributes:
        angle: Rotation from the x axis of the frame towards its y axis [rad].
        std: Standard deviation of the angle [rad].
        symmetry: Number of equal rotations per revolution after which the object looks the same; the angle is
            known up to such a rotation.
    """

    angle: float
    std: float
    symmetry: int = 1

    def compute_difference(self, other: Yaw) -> float:
        """Return the smallest rotation to another yaw [rad] that the symmetries of both permit."""
        period = math.tau / max(self.symmetry, other.symmetry)
        return math.remainder(other.angle - self.angle, period)


class HeldPose(NamedTuple):
    """Place of a held object relative to the tool.

    Attributes:
        yaw: Yaw relative to the tool.
        offset: Position of the middle of the object, along the x and y axes of the tool [m].
    """

    yaw: Yaw
    offset: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Pose:
    """Rigid transform: a rotation followed by a translation.

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
        """Return the pose with a position `(3,)` [m] and a quaternion `(x, y, z, w)` of any norm."""
        components = np.asarray(quaternion, dtype=float)
        x, y, z, w = components / math.hypot(*components)
        x_row = [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)]
        y_row = [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)]
        z_row = [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]
        return Pose(np.array([x_row, y_row, z_row]), np.asarray(position, dtype=float))

    def __matmul__(self, other: Pose) -> Pose:
        return Pose(self.rotation @ other.rotation, self.rotation @ other.position + self.position)

    def inverse(self) -> Pose:
        """Return the inverse transform."""
        return Pose(self.rotation.T, -self.rotation.T @ self.position)

    def apply(self, points: ArrayLike) -> Array:
        """Return transformed points `(3,)` or `(N, 3)` [m]: `X_WC` maps coordinates in frame C to frame W."""
        return np.asarray(points, dtype=float) @ self.rotation.T + self.position

    @property
    def quaternion(self) -> Array:
        """Rotation as a unit quaternion `(x, y, z, w)` with `w >= 0`.

        Shepperd's method: the largest component is computed first, so that the result is numerically stable.
        """
        r = self.rotation
        diagonal_and_trace = [r[0, 0], r[1, 1], r[2, 2], np.trace(r)]
        i = int(np.argmax(diagonal_and_trace))  # index of the largest component
        if i == 3:
            q = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], 1 + np.trace(r)])
        else:
            j = (i + 1) % 3
            k = (i + 2) % 3
            q = np.empty(4)
            q[i] = 1 + r[i, i] - r[j, j] - r[k, k]
            q[j] = r[j, i] + r[i, j]
            q[k] = r[k, i] + r[i, k]
            q[3] = r[k, j] - r[j, k]
        q /= np.linalg.norm(q)
        return q if q[3] >= 0 else -q

    @property
    def rotation_vector(self) -> Array:
        """Rotation axis times rotation angle (0 to pi) [rad], `(3,)`; OpenCV calls this vector `rvec`."""
        # scipy.spatial is imported here because the import takes 0.3 s, and few runs need it.
        from scipy.spatial.transform import Rotation

        return np.asarray(Rotation.from_matrix(self.rotation).as_rotvec())

    def to_rounded_list(self, digits: int = 6) -> list[float]:
        """Return position and quaternion as seven numbers, rounded to `digits` decimal places."""
        return [round(float(value), digits) for value in (*self.position, *self.quaternion)]


def format_point(point: ArrayLike) -> str:
    """Return a point `(3,)` [m] with its unit, for messages."""
    x, y, z = np.asarray(point).tolist()
    return f"({x:.3f}, {y:.3f}, {z:.3f}) m"


def rotate_about_z(angle: float) -> Array:
    """Return the rotation `(3, 3)` by `angle` [rad] about the z axis."""
    c = math.cos(angle)
    s = math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def make_tool_down_pose(position: ArrayLike, yaw: float = 0.0) -> Pose:
    """Return the tool pose `X_WT` at `position` `(3,)` [m] with the z axis vertically down.

    At `yaw` 0 [rad], the y axes of tool and world are parallel, and their x axes are opposite. An arm whose
    joints 3 and 5 are at zero has this orientation if joints 1 and 7 have equal angles.
    """
    return Pose(rotate_about_z(yaw) @ np.diag([-1.0, 1.0, -1.0]), np.asarray(position, dtype=float))


def compute_tool_yaw(X_WT: Pose) -> float:
    """Return the `yaw` [rad] of `make_tool_down_pose` with which a tool that points down has a pose."""
    return math.atan2(-X_WT.rotation[0, 1], X_WT.rotation[1, 1])
