"""Kinematics of any arm with revolute joints, from its URDF; the inverse kinematics is numerical.

The tool axis is the axis of the last joint. Position and axis of the tool therefore depend on the other
joints only: Newton steps solve these five conditions, and the last joint then turns the tool to its yaw.

A branch is a joint configuration: the solution of a pose in a branch is the one that a continuous motion of
the tool from this configuration reaches.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from executive.arms.urdf import read_chain
from executive.cell.arm_config import ArmConfig
from executive.errors import Unreachable
from executive.geometry import Array, Pose, format_point, rotate_about_z
from executive.motion.joints import BranchKey, JointLimits, JointRange, wrap_angles

NEWTON_STEP_COUNT = 16
"""Maximum number of Newton steps."""
MAX_NEWTON_STEP = 0.5
"""Maximum change of a joint in a Newton step [rad]."""
MAX_ERROR = 1e-10
"""Maximum error of a solution: of the position [m], and of the components of the tool axis."""
MAX_ERROR_OF_5_JOINTS = 1e-4
"""The same for an arm with fewer than six joints, whose URDF may contain rounded right angles."""
MAX_TURN = 1e-6
"""Maximum turn of the last joint [rad] after which the position of the tool counts as unchanged."""
DAMPING = 1e-12
"""Damping of the Newton steps, which avoids a division by 0 in a singular configuration."""
MAX_JOINT_STEP = 0.7
"""Maximum change of a joint between two neighbouring poses on a continuous path [rad]."""
MAX_TOOL_STEP = 0.08
"""Maximum distance of two neighbouring poses on a path that is followed step by step [m]."""
TABLE_SIZE = 6000
"""Number of stored random configurations, from which the start configurations of a search are chosen."""
START_COUNTS = {6: (96, 600), 7: (160, 1500)}
"""Number of start configurations in the first and in the second search, by number of joints; more joints have
the numbers of seven joints, fewer joints have the numbers of six joints."""
COARSE_ANGLE_STEP = math.radians(2.0)
"""Distance between redundancy angles below which a search is the second one [rad]."""
AXIS_WEIGHT = 0.3
"""Weight of a difference of the tool axes relative to a difference of the positions [m]."""
SAME_SOLUTION_TOLERANCE = 2e-3
"""Maximum difference between two equal solutions, in sine and cosine of each joint."""

FindSolutions = Callable[[Pose, Array, float], Array]
"""Function that returns approximate solutions `(B, n)` [rad] of a tool pose in the world, from the joint
positions `(n,)` [rad] before the motion and the distance between redundancy angles [rad]."""


class ChainKinematics:
    """Kinematics of the arm of a URDF; implements `executive.motion.joints.Kinematics`.

    The constructor implements `executive.motion.joints.KinematicsFactory`.

    Attributes:
        offsets: Pose of each joint in the frame of the joint before; of the first joint, in the world.
        X_nT: Pose of the tool in the frame of the last joint.
        find_solutions: Finds the solutions of a tool pose; at first, the numerical search.
        solver_name: Name of the solver that `find_solutions` belongs to.
    """

    def __init__(self, arm: ArmConfig, tool_length: float, min_link_distance: float | None = None) -> None:
        del min_link_distance  # The collision check keeps the links apart.
        self.chain = read_chain(arm.urdf, arm.flange)
        self.joint_range: JointRange = JointLimits.from_config(arm.limits).position
        base = Pose(rotate_about_z(math.radians(arm.base.yaw_deg)), np.array(arm.base.position))
        self.offsets = (base @ self.chain.offsets[0], *self.chain.offsets[1:])
        self.X_nT = self.chain.X_nF @ Pose.of([0.0, 0.0, tool_length])
        self._joint_count = len(self.offsets)
        self._max_error = MAX_ERROR if self._joint_count > 5 else MAX_ERROR_OF_5_JOINTS
        self._turn_direction = float(np.sign(self.X_nT.rotation[2, 2]))
        self.find_solutions: FindSolutions = self._search
        self.solver_name = "numeric"
        self._table: tuple[Array, Array] | None = None
        """Random configurations `(N, n)` [rad], and position and weighted axis of their tools `(N, 6)`."""

    def compute_tool_pose(self, q: ArrayLike) -> Pose:
        """Return the tool pose."""
        X = Pose.identity()
        for offset, angle in zip(self.offsets, np.asarray(q, dtype=float).tolist(), strict=True):
            X = X @ offset
            X = Pose(X.rotation @ rotate_about_z(angle), X.position)
        return X @ self.X_nT

    def compute_tcps_and_axes(self, qs: Array) -> tuple[Array, Array]:
        """Return tool centre points and tool axes, transformed joint by joint from the tool to the base."""
        angles = np.ascontiguousarray(qs.T)
        cosines = np.cos(angles)
        sines = np.sin(angles)
        vectors = np.empty((3, 2, len(qs)))
        vectors[:, 0] = self.X_nT.position[:, None]
        vectors[:, 1] = self.X_nT.rotation[:, 2, None]
        for joint in range(self._joint_count - 1, -1, -1):
            turned = vectors.copy()
            turned[0] = cosines[joint] * vectors[0] - sines[joint] * vectors[1]
            turned[1] = sines[joint] * vectors[0] + cosines[joint] * vectors[1]
            offset = self.offsets[joint]
            vectors = (offset.rotation @ turned.reshape(3, -1)).reshape(vectors.shape)
            vectors[:, 0] += offset.position[:, None]
        return vectors[:, 0].T, vectors[:, 1].T

    def find_branch(self, q: ArrayLike) -> BranchKey:
        """Return the joint positions themselves."""
        return tuple(np.asarray(q, dtype=float).tolist())

    def solve(self, poses: Sequence[Pose], branch: BranchKey) -> Array:
        """Return the solutions `(N, n)` [rad] on a path from the configuration `branch` through the poses."""
        start = np.array(branch)
        qs, is_solved = self._approach(np.tile(start, (len(poses), 1)), poses)
        steps = np.abs(np.diff(qs[:, :-1], axis=0, prepend=start[None, :-1]))
        if is_solved.all() and steps.max() <= MAX_JOINT_STEP:
            return qs
        q = start[None]
        X_WT = self.compute_tool_pose(start)
        for index, pose in enumerate(poses):
            q = self._follow_line(q, X_WT, pose)
            if np.isnan(q).any():
                raise Unreachable(f"the tool cannot reach {format_point(pose.position)} in its configuration")
            qs[index] = q[0]
            X_WT = pose
        return qs

    def solve_all(
        self, poses: Sequence[Pose], q_seed: ArrayLike, angle_step: float
    ) -> tuple[Array, Sequence[BranchKey]]:
        """Return the solutions `(N, B, n)` [rad] of the poses of a path in all `B` branches."""
        seed = np.asarray(q_seed, dtype=float)
        approximate_qs = self.find_solutions(poses[-1], seed, angle_step)
        found_qs, is_solved = self._approach(approximate_qs, [poses[-1]] * len(approximate_qs))
        if not is_solved.any():
            raise self._make_unreachable_error(poses[-1].position)
        qs = self._remove_turns(found_qs[is_solved], seed)
        # The last joint can still turn.
        is_inside = self.joint_range.without_last().contains(qs[:, :-1])
        qs = qs[is_inside] if is_inside.any() else qs
        qs_by_pose = [qs]
        for pose, next_pose in itertools.pairwise(reversed(poses)):
            qs_by_pose.insert(0, self._follow_line(qs_by_pose[0], pose, next_pose))
        return np.array(qs_by_pose), [tuple(q) for q in qs.tolist()]

    def _make_unreachable_error(self, position: Array) -> Unreachable:
        shoulder = self.offsets[0].position
        reach = self.chain.reach + float(np.linalg.norm(self.X_nT.position - self.chain.X_nF.position))
        distance = float(np.linalg.norm(position - shoulder))
        return Unreachable(
            f"the tool cannot reach {format_point(position)}: no configuration of the arm brings the tool "
            f"there, {distance:.3f} m from the first joint; arm and tool are together {reach:.2f} m long"
        )

    def _remove_turns(self, qs: Array, seed: Array) -> Array:
        """Return the equivalent positions `(B, n)` [rad] in the range nearest to `seed` `(n,)` [rad]."""
        nearest_qs = seed + wrap_angles(qs - seed)
        lower, upper = self.joint_range
        nearest_qs = np.where(nearest_qs > upper, nearest_qs - math.tau, nearest_qs)
        return np.where(nearest_qs < lower, nearest_qs + math.tau, nearest_qs)

    def _search(self, X_WT: Pose, q_seed: Array, angle_step: float) -> Array:
        """Return start configurations `(B, n)` [rad] near a pose: `q_seed`, and the nearest stored ones."""
        if self._table is None:
            rng = np.random.default_rng(0)
            lower, upper = np.clip(self.joint_range, -math.pi, math.pi)
            table_qs = rng.uniform(lower, upper, (TABLE_SIZE, self._joint_count))
            tcps, axes = self.compute_tcps_and_axes(table_qs)
            self._table = table_qs, np.hstack([tcps, AXIS_WEIGHT * axes])
        table_qs, places = self._table
        counts = START_COUNTS[min(max(self._joint_count, 6), 7)]
        count = counts[int(angle_step < COARSE_ANGLE_STEP)]
        place = np.concatenate([X_WT.position, AXIS_WEIGHT * X_WT.rotation[:, 2]])
        nearest = np.argpartition(((places - place) ** 2).sum(axis=1), count)[:count]
        start_qs = np.vstack([q_seed, table_qs[np.sort(nearest)]])
        qs, is_solved = self._approach(start_qs, [X_WT] * len(start_qs))
        return self._select_different(qs[is_solved])

    def _select_different(self, qs: Array) -> Array:
        """Return the first of equal configurations `(B, n)` [rad], without regard to the last joint."""
        points = np.hstack([np.cos(qs[:, :-1]), np.sin(qs[:, :-1])]) / (4 * SAME_SOLUTION_TOLERANCE)
        _, first = np.unique(np.round(points), axis=0, return_index=True)
        return qs[np.sort(first)]

    def _follow_line(self, qs: Array, X_WT: Pose, end: Pose) -> Array:
        """Return the configurations `(B, n)` [rad] at the end of a straight motion of the tool.

        The motion leads from the pose of all `qs` `(B, n)` [rad] to `end`; a row is NaN if it leads nowhere.
        """
        displacement = end.position - X_WT.position
        count = max(1, math.ceil(float(np.linalg.norm(displacement)) / MAX_TOOL_STEP))
        qs = qs.copy()
        for fraction in np.linspace(0.0, 1.0, count + 1)[1:].tolist():
            rows = np.flatnonzero(~np.isnan(qs[:, 0]))
            pose = Pose(end.rotation, X_WT.position + fraction * displacement)
            next_qs, is_solved = self._approach(qs[rows], [pose] * len(rows))
            is_continuous = np.abs(next_qs - qs[rows])[:, :-1].max(axis=1, initial=0.0) <= MAX_JOINT_STEP
            qs[rows] = np.where((is_solved & is_continuous)[:, None], next_qs, np.nan)
        return qs

    def _approach(self, start_qs: Array, poses: Sequence[Pose]) -> tuple[Array, NDArray[np.bool_]]:
        """Move configurations `(B, n)` [rad] by Newton steps to `B` poses.

        Returns:
            The configurations, and the mask `(B,)` of those that reach their pose.
        """
        qs = start_qs.copy()
        is_solved = np.zeros(len(qs), dtype=bool)
        if not len(qs):
            return qs, is_solved
        rows = np.arange(len(qs))
        # Columns of the goal rotations and goal positions, (3, B) each.
        x_goal, y_goal, z_goal = np.array([pose.rotation for pose in poses]).transpose(2, 1, 0)
        p_goal = np.array([pose.position for pose in poses]).T
        for step in range(NEWTON_STEP_COUNT + 1):
            frame, p, axes, origins = self._compute_joint_axes(qs[rows])
            # The x axis of the tool determines the yaw.
            turn = np.arctan2(_dot(frame[:, 1], x_goal[:, rows]), _dot(frame[:, 0], x_goal[:, rows]))
            turn = np.where(_dot(frame[:, 2], z_goal[:, rows]) > 0, turn, 0.0)
            qs[rows, -1] += self._turn_direction * turn
            u = x_goal[:, rows]
            v = y_goal[:, rows]
            error = np.vstack([p_goal[:, rows] - p, -_dot(u, frame[:, 2]), -_dot(v, frame[:, 2])])
            is_turned = (np.abs(turn) <= MAX_TURN) & (_dot(frame[:, 2], z_goal[:, rows]) >= 0)
            max_error = np.abs(error).max(axis=0)
            is_solved[rows] = is_turned & (max_error <= self._max_error)
            is_left = ~(is_turned & (max_error <= MAX_ERROR))
            if step == NEWTON_STEP_COUNT or not is_left.any():
                break
            jacobian = np.empty((5, self._joint_count - 1, len(rows)))
            jacobian[:3] = _cross(axes, p[:, None] - origins)
            jacobian[3] = _dot(axes, _cross(frame[:, 2], u)[:, None])
            jacobian[4] = _dot(axes, _cross(frame[:, 2], v)[:, None])
            rows = rows[is_left]
            change = _solve_least_squares(jacobian[:, :, is_left], error[:, is_left])
            largest = np.abs(change).max(axis=1, keepdims=True)
            qs[rows, :-1] += change * np.minimum(1.0, MAX_NEWTON_STEP / np.maximum(largest, 1e-12))
        return qs, is_solved

    def _compute_joint_axes(self, qs: Array) -> tuple[Array, Array, Array, Array]:
        """Return, for configurations `(B, n)` [rad], frame and place of the tool, and the first n - 1 joints.

        Returns:
            Columns of the rotation of the tool `(3, 3, B)`, its position `(3, B)` [m], axes of the joints and
            their origins [m], `(3, n - 1, B)` each. The first index is the coordinate in the world.
        """
        count = len(qs)
        cosines = np.cos(qs.T)
        sines = np.sin(qs.T)
        frame = np.broadcast_to(np.eye(3)[:, :, None], (3, 3, count))
        p = np.zeros((3, count))
        axes = np.empty((3, self._joint_count, count))
        origins = np.empty((3, self._joint_count, count))
        for joint, offset in enumerate(self.offsets):
            p = p + offset.position @ frame
            frame = offset.rotation.T @ frame
            x = frame[:, 0].copy()
            frame[:, 0] = cosines[joint] * x + sines[joint] * frame[:, 1]
            frame[:, 1] = cosines[joint] * frame[:, 1] - sines[joint] * x
            axes[:, joint] = frame[:, 2]
            origins[:, joint] = p
        p = p + self.X_nT.position @ frame
        frame = self.X_nT.rotation.T @ frame
        return frame, p, axes[:, :-1], origins[:, :-1]


def _dot(a: Array, b: Array) -> Array:
    """Return the scalar products of vectors `(3, ...)`."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def _cross(a: Array, b: Array) -> Array:
    """Return the vector products of vectors `(3, ...)`; np.cross takes three times as long."""
    x = a[1] * b[2] - a[2] * b[1]
    y = a[2] * b[0] - a[0] * b[2]
    return np.array([x, y, a[0] * b[1] - a[1] * b[0]])


def _solve_least_squares(jacobian: Array, error: Array) -> Array:
    """Return the smallest joint changes `(B, m)` [rad] with `jacobian` `(5, m, B)` for errors `(5, B)`."""
    J = np.moveaxis(jacobian, -1, 0)
    JT = J.swapaxes(1, 2)
    e = error.T[:, :, None]
    if J.shape[2] < len(error):  # With fewer than six joints, the conditions depend on each other.
        return np.asarray(np.linalg.solve(JT @ J + DAMPING * np.eye(J.shape[2]), JT @ e)[:, :, 0])
    return np.asarray((JT @ np.linalg.solve(J @ JT + DAMPING * np.eye(len(error)), e))[:, :, 0])
