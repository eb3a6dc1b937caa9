"""Test arm with six joints: a shoulder with two axes, an elbow, and a spherical wrist.

R_WT = Rz(q1) Ry(q2) Ry(q3) Rz(q4) Ry(q5) Rz(q6)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from executive.errors import Unreachable
from executive.geometry import Array, Pose
from executive.motion.joints import BranchKey, JointRange, wrap_angles

HEIGHT, UPPER_ARM, FOREARM, WRIST_TO_FLANGE = 0.30, 0.45, 0.42, 0.10  # [m]
AXES = "zyyzyz"
FLIPS = tuple(product((1, -1), repeat=3))
"""Signs of shoulder, elbow and wrist in each configuration; a configuration is `(index,)`."""


class SixJointArm:
    """Implements `executive.motion.joints.Kinematics`."""

    def __init__(self, tool_length: float, joint_range: JointRange) -> None:
        self.joint_range = joint_range
        self._tool_length = tool_length
        self._wrist_to_tool = WRIST_TO_FLANGE + tool_length

    def compute_tool_pose(self, q: ArrayLike) -> Pose:
        R, p = self._last_frame(q)
        return Pose(R, p + self._wrist_to_tool * R[:, 2])

    def compute_joint_frames(self, q: ArrayLike) -> tuple[Pose, ...]:
        frames = []
        R, p = np.eye(3), np.array([0.0, 0.0, HEIGHT])
        lengths = {2: UPPER_ARM, 3: FOREARM}
        for i, angle in enumerate(np.asarray(q, dtype=float)):
            p = p + lengths.get(i, 0.0) * R[:, 2]
            R = R @ rotation(AXES[i], angle)
            frames.append(Pose(R, p))
        return tuple(frames)

    def compute_tcps_and_axes(self, qs: Array) -> tuple[Array, Array]:
        axis = np.tile([0.0, 0.0, 1.0], (len(qs), 1))
        for joint in (4, 3):
            axis = rotated(axis, AXES[joint], qs[:, joint])
        tip = self._wrist_to_tool * axis
        for joint, length in ((2, FOREARM), (1, UPPER_ARM), (0, 0.0)):
            tip = np.add(tip, (0.0, 0.0, length))
            tip, axis = (rotated(vectors, AXES[joint], qs[:, joint]) for vectors in (tip, axis))
        return np.add(tip, (0.0, 0.0, HEIGHT)), axis

    def find_branch(self, q: ArrayLike) -> BranchKey:
        (qs,), branches = self.solve_all([self.compute_tool_pose(q)], q, 0.0)
        return branches[int(np.argmin(np.abs(wrap_angles(qs - q)).max(axis=1)))]

    def solve(self, poses: Sequence[Pose], branch: BranchKey) -> Array:
        (index,) = branch
        return np.array([self._solve_pose(X_WT)[int(index)] for X_WT in poses])

    def solve_all(
        self, poses: Sequence[Pose], q_seed: ArrayLike, angle_step: float
    ) -> tuple[Array, list[BranchKey]]:
        return np.array([self._solve_pose(pose) for pose in poses]), [(index,) for index in range(len(FLIPS))]

    def _solve_pose(self, X_WT: Pose) -> Array:
        x, y, z = X_WT.position - self._wrist_to_tool * X_WT.rotation[:, 2] - (0.0, 0.0, HEIGHT)
        radius = math.hypot(x, y)
        cos3 = (radius**2 + z**2 - UPPER_ARM**2 - FOREARM**2) / (2 * UPPER_ARM * FOREARM)
        if abs(cos3) > 1:
            raise Unreachable(f"the wrist cannot be {math.hypot(radius, z):.3f} m from the shoulder")
        qs = np.empty((len(FLIPS), 6))
        for row, (shoulder, elbow, wrist) in zip(qs, FLIPS, strict=True):
            row[0] = math.atan2(shoulder * y, shoulder * x)
            row[2] = elbow * math.acos(cos3)
            forearm = math.atan2(FOREARM * math.sin(row[2]), UPPER_ARM + FOREARM * math.cos(row[2]))
            row[1] = math.atan2(shoulder * radius, z) - forearm
            R_W3 = rotation("z", row[0]) @ rotation("y", row[1] + row[2])
            a, b, c = (R_W3.T @ X_WT.rotation).T
            row[4] = wrist * math.atan2(math.hypot(c[0], c[1]), c[2])
            row[3] = math.atan2(wrist * c[1], wrist * c[0])
            row[5] = math.atan2(wrist * b[2], -wrist * a[2])
        return wrap_angles(qs)

    def _last_frame(self, q: ArrayLike) -> tuple[Array, Array]:
        frame = self.compute_joint_frames(q)[-1]
        return frame.rotation, frame.position


def rotation(axis: str, angle: float) -> Array:
    """The rotation matrix about z or y."""
    return rotated(np.eye(3), axis, np.full(3, angle)).T


def rotated(vectors: Array, axis: str, angles: Array) -> Array:
    """Vectors `(N, 3)`, each rotated about z or y by its own angle [rad]."""
    c, s = np.cos(angles), np.sin(angles)
    x, y, z = vectors.T
    columns = [c * x - s * y, s * x + c * y, z] if axis == "z" else [c * x + s * z, y, c * z - s * x]
    return np.column_stack(columns)
