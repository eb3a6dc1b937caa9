"""Forward and analytic inverse kinematics of the KUKA LBR iiwa 14.

The seven joints form a shoulder, an elbow and a wrist (S-R-S): the axes of joints 1 to 3 intersect in the
shoulder, and the axes of joints 5 to 7 in the wrist:

    R_WT = Rz(q1) Ry(q2) Rz(q3) Ry(-q4) Rz(q5) Ry(q6) Rz(q7).

A tool pose determines the position of the wrist, and the triangle of shoulder, elbow and wrist determines
joint 4. The elbow is free to rotate about the line from the shoulder to the wrist; the angle of this rotation
is the redundancy angle. Each redundancy angle has eight solutions (flips): shoulder, elbow and wrist can each
be flipped, `(a, b, c) -> (a + π, -b, c + π)`. A branch is `(index of the flip, redundancy angle)`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from executive.cell.arm_config import ArmConfig
from executive.errors import InputError, Unreachable
from executive.geometry import Array, Pose, format_point
from executive.motion.joints import BranchKey, JointLimits, JointRange, wrap_angles

JOINT_COUNT = 7
"""Number of joints of the arm."""

# Lengths between base, shoulder, elbow, wrist and link 7 [m], from pybullet_data kuka_iiwa/model.urdf.
SHOULDER_HEIGHT = 0.36
UPPER_ARM = 0.42
FOREARM = 0.40
WRIST_TO_LINK_7 = 0.081

FLIPS = np.array([[s, e, w] for s in (1, -1) for e in (1, -1) for w in (1, -1)])
"""Signs of joints 2, 4 and 6 in the eight solutions of one redundancy angle `(8, 3)`."""

_JOINT_6_ANGLES = (120.0, 115.0, 110.0, 105.0, 100.0, 95.0, 90.0)  # [degree]
_LINK_DISTANCES = (-0.0132, -0.0059, 0.0012, 0.0079, 0.0141, 0.0195, 0.0237)
"""Distances between links 5 and 7 at `_JOINT_6_ANGLES` [m], negative if the links overlap."""

# A flip changes the unflipped joint positions `q` to `_FLIP_SIGNS * q + _FLIP_OFFSETS`.
_FLIP_OFFSETS = np.zeros((8, 7))
_FLIP_OFFSETS[:, [0, 2]] += (FLIPS[:, :1] < 0) * math.pi
_FLIP_OFFSETS[:, [2, 4]] += (FLIPS[:, 1:2] < 0) * math.pi
_FLIP_OFFSETS[:, [4, 6]] += (FLIPS[:, 2:] < 0) * math.pi
_FLIP_SIGNS = np.ones((8, 7))
_FLIP_SIGNS[:, [1, 3, 5]] = FLIPS
_ROUNDING_ERROR = 1e-9  # [m]

_LENGTHS = {3: UPPER_ARM, 5: FOREARM}
"""Length of the link before a joint [m], by index of the joint."""
_AXES = np.array([[0, 0, 1], [0, 1, 0], [0, 0, 1], [0, -1, 0], [0, 0, 1], [0, 1, 0], [0, 0, 1]])
"""Axis of each joint in the frame before the joint."""
# Matrices `(7, 3, 3)` that map a vector to its part along the axis, to the rest, and to its cross product.
_PARALLEL_PARTS = _AXES[:, :, None] * _AXES[:, None]
_NORMAL_PARTS = np.eye(3) - _PARALLEL_PARTS
_CROSS_PRODUCTS = np.cross(_AXES[:, None], np.eye(3)).swapaxes(1, 2)


def interpolate_max_joint_6_angle(min_link_distance: float) -> float:
    """Return the maximum angle of joint 6 [rad] at which links 5 and 7 keep a minimum distance [m].

    Only joint 6 changes the distance of links 5 and 7, apart from an error of up to 0.3 mm. The distances
    were measured on the collision shapes of pybullet_data kuka_iiwa/model.urdf. If no angle down
    to 90° keeps the distance, the result is 90°.
    """
    return math.radians(float(np.interp(min_link_distance, _LINK_DISTANCES, _JOINT_6_ANGLES)))


class Iiwa14:
    """Kinematics of an iiwa 14; implements `executive.motion.joints.Kinematics`.

    The constructor implements `executive.motion.joints.KinematicsFactory`: `min_link_distance` is the
    distance between links 5 and 7, which limits joint 6.
    """

    def __init__(self, arm: ArmConfig, tool_length: float, min_link_distance: float | None = None) -> None:
        if arm.joint_count != JOINT_COUNT:
            raise InputError(
                f"the solver of the arm {arm.arm} needs {JOINT_COUNT} joints, not {arm.joint_count}"
            )
        joint_range = JointLimits.from_config(arm.limits).position
        lower = joint_range.lower.copy()
        upper = joint_range.upper.copy()
        if min_link_distance is not None:
            max_angle = interpolate_max_joint_6_angle(min_link_distance)
            lower[5] = max(lower[5], -max_angle)
            upper[5] = min(upper[5], max_angle)
        self.joint_range = JointRange(lower, upper)
        self._base_position = np.array(arm.base.position)
        # The base turns about the axis of joint 1.
        self._base_yaw = math.radians(arm.base.yaw_deg)
        self._wrist_to_tool = WRIST_TO_LINK_7 + arm.flange.offset + tool_length
        cos4 = math.cos(max(-lower[3], upper[3]))
        # Law of cosines in the triangle of shoulder, elbow and wrist.
        self._min_wrist_distance = math.sqrt(UPPER_ARM**2 + FOREARM**2 + 2 * UPPER_ARM * FOREARM * cos4)
        self._max_wrist_distance = UPPER_ARM + FOREARM

    def compute_tool_pose(self, q: ArrayLike) -> Pose:
        """Return the tool pose."""
        return self._compute_frames(q)[-1]

    def compute_tcps_and_axes(self, qs: Array) -> tuple[Array, Array]:
        """Return tool centre points and tool axes.

        Both vectors are transformed joint by joint from the wrist to the base, which takes a fifth of the
        time of complete frames. Joint 7 has no effect, because its axis is the tool axis.
        """
        angles = qs.T[:6].copy(order="C")  # Operations on contiguous rows are faster.
        angles[0] += self._base_yaw
        cosines = np.cos(angles)
        sines = np.sin(angles)
        vectors = np.empty((3, 2, len(qs)))
        tcp = vectors[:, 0]
        axis = vectors[:, 1]
        axis[0] = cosines[4] * sines[5]
        axis[1] = sines[4] * sines[5]
        axis[2] = cosines[5]
        tcp[:] = self._wrist_to_tool * axis
        tcp[2] += FOREARM
        _rotate(vectors, cosines[3], -sines[3], 3)
        tcp[2] += UPPER_ARM
        for joint in (2, 1, 0):
            _rotate(vectors, cosines[joint], sines[joint], joint)
        tcp[2] += SHOULDER_HEIGHT
        tcp += self._base_position[:, None]
        return tcp.T, axis.T

    def find_branch(self, q: ArrayLike) -> BranchKey:
        """Return the index of the flip, and the redundancy angle [rad]; 0: elbow up."""
        is_flipped = np.asarray(q, dtype=float)[[1, 3, 5]] < 0  # shoulder, elbow, wrist
        frames = self._compute_frames(q)
        shoulder, elbow, wrist = (frames[i].position for i in (1, 3, 5))
        _, up, side = _compute_elbow_frame(wrist - shoulder)
        angle = math.atan2(float((elbow - shoulder) @ side), float((elbow - shoulder) @ up))
        return int(is_flipped @ [4, 2, 1]), angle

    def solve(self, poses: Sequence[Pose], branch: BranchKey) -> Array:
        """Return the joint positions in one branch."""
        flip, angle = branch
        return self._solve_angles(poses, np.array([angle]))[:, int(flip), 0]

    def solve_all(
        self, poses: Sequence[Pose], q_seed: ArrayLike, angle_step: float
    ) -> tuple[Array, Sequence[BranchKey]]:
        """Return the solutions for all flips and evenly spaced redundancy angles, that of `q_seed` first."""
        offsets = np.radians(np.arange(0.0, 360.0, math.degrees(angle_step)))
        angles = self.find_branch(q_seed)[1] + offsets
        solutions = [self._solve_angles([pose], angles).reshape(-1, JOINT_COUNT) for pose in poses]
        return np.array(solutions), list(product(range(len(FLIPS)), angles.tolist()))

    def _solve_angles(self, poses: Sequence[Pose], angles: Array) -> Array:
        """Return the solutions `(N, 8, S, 7)` [rad] of `N` tool poses, by flip and redundancy angle.

        `angles` are the redundancy angles `(S,)` [rad].

        Raises:
            Unreachable: The wrist is too near to the shoulder or too far from the shoulder.
        """
        elbow_frames, triangle_angles = zip(*map(self._solve_triangle, poses), strict=True)
        # The vectors have the shape (N, 1, 3), the angles of the triangles have the shape (N, 1, 1).
        wrist_direction, up, side = np.array(elbow_frames).swapaxes(0, 1)[:, :, None]
        upper_arm_angle, q4 = np.array(triangle_angles).T[:, :, None, None]
        cosines = np.cos(angles)[:, None]
        sines = np.sin(angles)[:, None]
        elbow_direction = cosines * up + sines * side
        # Frame 3: z along the upper arm, y normal to the triangle of shoulder, elbow and wrist.
        z3 = np.cos(upper_arm_angle) * wrist_direction + np.sin(upper_arm_angle) * elbow_direction
        y3 = cosines * side - sines * up
        x3 = np.cos(upper_arm_angle) * elbow_direction - np.sin(upper_arm_angle) * wrist_direction
        x4 = np.cos(q4) * x3 + np.sin(q4) * z3
        z4 = -np.sin(q4) * x3 + np.cos(q4) * z3
        R_47 = np.stack([x4, y3, z4], axis=-2) @ np.array([pose.rotation for pose in poses])[:, None]

        unflipped_qs = np.empty((len(poses), 1, len(angles), JOINT_COUNT))
        unflipped_qs[:, 0, :, :3] = _find_zyz_angles(x3, y3, z3)
        unflipped_qs[:, 0, :, 0] -= self._base_yaw
        unflipped_qs[..., 3] = q4
        unflipped_qs[:, 0, :, 4:] = _find_zyz_angles(*np.moveaxis(R_47, -1, 0))
        return wrap_angles(unflipped_qs * _FLIP_SIGNS[:, None] + _FLIP_OFFSETS[:, None])

    def _solve_triangle(self, X_WT: Pose) -> tuple[tuple[Array, Array, Array], tuple[float, float]]:
        """Return the frame of `_compute_elbow_frame`, the angle at the shoulder, and the angle of joint 4.

        The function solves the triangle of shoulder, elbow and wrist for a tool pose. The angle at the
        shoulder leads from the line to the wrist to the upper arm [rad].

        Raises:
            Unreachable: The wrist is too near to the shoulder or too far from the shoulder.
        """
        wrist = X_WT.position - self._wrist_to_tool * X_WT.rotation[:, 2]
        shoulder_to_wrist = wrist - self._base_position - (0.0, 0.0, SHOULDER_HEIGHT)
        distance = float(np.linalg.norm(shoulder_to_wrist))
        excess = distance - self._max_wrist_distance
        shortfall = self._min_wrist_distance - distance
        if max(excess, shortfall) > _ROUNDING_ERROR:
            cause = f"{excess:.3f} m beyond the reach of the arm ({self._max_wrist_distance:.2f} m)"
            if shortfall > 0:
                cause = f"{shortfall:.3f} m nearer than joint 4 permits ({self._min_wrist_distance:.2f} m)"
            raise Unreachable(
                f"the tool cannot reach {format_point(X_WT.position)}: its wrist would be {distance:.3f} m "
                f"from the shoulder, {cause}"
            )
        cos4 = (distance**2 - UPPER_ARM**2 - FOREARM**2) / (2 * UPPER_ARM * FOREARM)
        cos_upper_arm_angle = (UPPER_ARM**2 + distance**2 - FOREARM**2) / (2 * UPPER_ARM * distance)
        upper_arm_angle, q4 = (math.acos(min(1.0, max(-1.0, c))) for c in (cos_upper_arm_angle, cos4))
        return _compute_elbow_frame(shoulder_to_wrist), (upper_arm_angle, q4)

    def _compute_frames(self, q: ArrayLike) -> list[Pose]:
        """Return the frames of joints 1 to 7 at `q` `(7,)` [rad], followed by the frame of the tool."""
        angles = np.array(q, dtype=float)[:, None, None]
        angles[0] += self._base_yaw
        # Rodrigues' formula.
        joint_rotations = _PARALLEL_PARTS + np.cos(angles) * _NORMAL_PARTS + np.sin(angles) * _CROSS_PRODUCTS
        frames = []
        R = np.eye(3)
        p = self._base_position + np.array([0.0, 0.0, SHOULDER_HEIGHT])
        for joint, R_joint in enumerate(joint_rotations):
            if length := _LENGTHS.get(joint):
                p = p + length * R[:, 2]
            R = R @ R_joint
            frames.append(Pose(R, p))
        return [*frames, Pose(R, p + self._wrist_to_tool * R[:, 2])]


def _rotate(vectors: Array, cosines: Array, sines: Array, joint: int) -> None:
    """Rotate vectors `(3, ...)` in place about z, if the index of the joint is even, or about y."""
    turned = vectors[:2] if joint % 2 == 0 else vectors[::-2]  # x and y, or z and x
    c_turned = cosines * turned
    s_turned = sines * turned
    turned[0] = c_turned[0] - s_turned[1]
    turned[1] = s_turned[0] + c_turned[1]


def _find_zyz_angles(x: Array, y: Array, z: Array) -> Array:
    """Return `a`, `b >= 0`, `c` `(..., 3)` with `Rz(a) Ry(b) Rz(c) = [x y z]`, from columns `(..., 3)`."""
    sine = np.hypot(z[..., 0], z[..., 1])
    is_singular = sine < 1e-9  # Only the sum or difference of a and c is defined: a is set to 0.
    a = np.where(is_singular, 0.0, np.arctan2(z[..., 1], z[..., 0]))
    singular_c = np.arctan2(x[..., 1], np.where(z[..., 2] > 0, x[..., 0], -x[..., 0]))
    c = np.where(is_singular, singular_c, np.arctan2(y[..., 2], -x[..., 2]))
    return np.stack([a, np.arctan2(sine, z[..., 2]), c], axis=-1)


def _compute_elbow_frame(shoulder_to_wrist: Array) -> tuple[Array, Array, Array]:
    """Return three orthogonal unit vectors: from shoulder to wrist, as far upwards as possible, sideways."""
    direction = shoulder_to_wrist / np.linalg.norm(shoulder_to_wrist)
    up = np.array([0.0, 0.0, 1.0]) if abs(direction[2]) < 0.9999 else np.array([1.0, 0.0, 0.0])
    up = up - (up @ direction) * direction
    up /= np.linalg.norm(up)
    x, y, z = direction.tolist()
    u, v, w = up.tolist()
    return direction, up, np.array([y * w - z * v, z * u - x * w, x * v - y * u])  # faster than np.cross
