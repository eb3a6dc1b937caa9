"""Kinematics of any arm with revolute joints, from its URDF; the inverse kinematics is numerical.

The tool axis is the axis of the last joint. Position and axis of the tool therefore depend on the other
joints only: Newton steps solve these five conditions, and the last joint then turns the tool to its yaw.

A branch is a joint configuration: the solution of a pose in a branch is the one that a continuous motion of
the tool from this configuration reaches.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from executive.arms.urdf import align_z, read_chain
from executive.cell.arm_config import ArmConfig
from executive.errors import Unreachable
from executive.geometry import Array, Pose, format_point, rotate_about_z
from executive.motion.joints import BranchKey, JointLimits, JointRange, wrap_angles

MAX_STEP_COUNT = 16
"""Maximum number of Newton steps to a pose on a path."""
SEARCH_STEP_COUNT = 8
"""Maximum number of Newton steps in a search."""
MAX_NEWTON_STEP = 0.5
"""Maximum change of a joint in a Newton step [rad]."""
MAX_ERROR = 1e-9
"""Maximum error of a solution: of the position [m], and of the components of the tool axis."""
MAX_ERROR_OF_5_JOINTS = 1e-4
"""The same for an arm with fewer than six joints, whose URDF may contain rounded right angles."""
DAMPING = 1e-12
"""Damping of the Newton steps, which avoids a division by 0 in a singular configuration."""
MAX_JOINT_STEP = 0.7
"""Maximum change of a joint between two neighbouring poses on a continuous path [rad]."""
MAX_TOOL_STEP = 0.08
"""Maximum distance of two neighbouring poses on a path that is followed step by step [m]."""
TABLE_SIZE = 8000
"""Number of random configurations from which a table is made; a third to a fifth of them remain."""
MAX_TABLE_COUNT = 32
"""Maximum number of stored tables."""
DIRECTION_STEP = 0.1
"""Distance between the directions of the tool in two tables, in each component."""
START_COUNTS = {6: (160, 600), 7: (640, 2000)}
"""Numbers of configurations in a table that are near a pose, in the first and in the second search, by number
of joints; more joints count as seven, fewer joints as six."""
CELL_SIZES = {6: 1.0, 7: 0.5}
"""Size of the cells of the joint space [rad], by number of joints; a search has one start in each cell."""
MAX_START_EXCESS = 0.3
"""Maximum distance of a start from the range of the joints [rad]."""
RANGE_MARGIN = 1e-3
"""Distance from the ends of its range to which a joint returns in a second search [rad]."""
MAX_FINE_ANGLE_STEP = math.radians(2.0)
"""Distance between redundancy angles at or below which a search is the second one [rad]."""
SAME_SOLUTION_TOLERANCE = 2e-3
"""Maximum difference between two equal solutions, in sine and cosine of each joint."""

FindStarts = Callable[[Pose, Array, float], Array]
"""Function that returns configurations `(B, n)` [rad] near the solutions of a tool pose in the world, from
joint positions `(n,)` [rad] before a motion and a distance between redundancy angles [rad]."""


class ChainKinematics:
    """Kinematics of the arm of a URDF; implements `executive.motion.joints.Kinematics`.

    The constructor implements `executive.motion.joints.KinematicsFactory`.

    Attributes:
        offsets: Pose of each joint in the frame of the joint before; of the first joint, in the world.
        X_nT: Pose of the tool in the frame of the last joint.
        find_starts: Finds configurations near the solutions of a tool pose; by default, in a table.
        solver_name: Name of the solver that `find_starts` belongs to.
    """

    def __init__(self, arm: ArmConfig, tool_length: float, min_link_distance: float | None = None) -> None:
        del min_link_distance  # The collision check keeps the links apart.
        self.chain = read_chain(arm.urdf, arm.flange)
        self.joint_range: JointRange = JointLimits.from_config(arm.limits).position
        self._X_WB = Pose(rotate_about_z(math.radians(arm.base.yaw_deg)), np.array(arm.base.position))
        self._X_FT = Pose.of([0.0, 0.0, tool_length])
        self.offsets = (self._X_WB @ self.chain.offsets[0], *self.chain.offsets[1:])
        self.X_nT = self.chain.X_nF @ self._X_FT
        self._joint_count = len(self.offsets)
        self._size = min(max(self._joint_count, 6), 7)  # key of START_COUNTS and CELL_SIZES
        self._max_error = MAX_ERROR if self._joint_count > 5 else MAX_ERROR_OF_5_JOINTS
        self._turn_direction = float(np.sign(self.X_nT.rotation[2, 2]))
        self.find_starts: FindStarts = self._find_starts
        self.solver_name = "numeric"
        self._matrices = [make_matrix(X) for X in (*self.offsets, self.X_nT)]
        self._axis_error = float(np.abs([self.X_nT.position[:2], self.X_nT.rotation[:2, 2]]).max())
        """Largest difference of the tool from the axis of the last joint, in position [m] and direction."""
        self._get_table = functools.lru_cache(MAX_TABLE_COUNT)(self._make_table)

    def compute_tool_pose(self, q: ArrayLike) -> Pose:
        """Return the tool pose."""
        return self._X_WB @ self.chain.compute_frames(np.asarray(q, dtype=float))[-1] @ self._X_FT

    def compute_tcps_and_axes(self, qs: Array) -> tuple[Array, Array]:
        """Return tool centre points and tool axes, transformed joint by joint from the tool to the base."""
        matrices = self._matrices
        if self._axis_error < MAX_ERROR:  # The last joint moves neither of them.
            matrices = [*matrices[:-2], matrices[-2] @ matrices[-1]]
        angles = qs.T[: len(matrices) - 1].copy(order="C")  # Operations on contiguous rows are faster.
        cosines = np.cos(angles)
        sines = np.sin(angles)
        vectors = np.empty((4, 2, len(qs)))  # homogeneous coordinates
        vectors[:] = matrices[-1][:, [3, 2], None]
        for matrix, c, s in zip(matrices[-2::-1], cosines[::-1], sines[::-1], strict=True):
            c_vectors = c * vectors[:2]
            s_vectors = s * vectors[:2]
            np.subtract(c_vectors[0], s_vectors[1], out=vectors[0])
            np.add(c_vectors[1], s_vectors[0], out=vectors[1])
            vectors = (matrix @ vectors.reshape(4, -1)).reshape(vectors.shape)
        return vectors[:3, 0].T, vectors[:3, 1].T

    def find_branch(self, q: ArrayLike) -> BranchKey:
        """Return the joint positions themselves."""
        return tuple(np.asarray(q, dtype=float).tolist())

    def solve(self, poses: Sequence[Pose], branch: BranchKey) -> Array:
        """Return the solutions `(N, n)` [rad] that motions from the configuration `branch` reach."""
        qs = self._move(np.tile(branch, (len(poses), 1)), poses)
        for pose in itertools.compress(poses, np.isnan(qs[:, 0])):
            raise Unreachable(f"the tool cannot reach {format_point(pose.position)} in its configuration")
        return qs

    def solve_all(
        self, poses: Sequence[Pose], q_seed: ArrayLike, angle_step: float
    ) -> tuple[Array, Sequence[BranchKey]]:
        """Return the solutions `(N, B, n)` [rad] of the poses of a path in all `B` branches.

        The branches are the solutions of the last pose.
        """
        seed = np.asarray(q_seed, dtype=float)
        start_qs = self._remove_turns(self.find_starts(poses[-1], seed, angle_step), seed)
        # The last joint can still turn to another yaw.
        excess = self.joint_range.compute_excess(start_qs)[:, :-1].max(axis=1)
        is_near = excess < MAX_START_EXCESS
        start_qs = start_qs[is_near] if is_near.any() else start_qs
        qs, is_solved = self._approach(start_qs, poses[-1:], SEARCH_STEP_COUNT)
        if angle_step <= MAX_FINE_ANGLE_STEP:
            further_qs, is_further_solved = self._approach(start_qs, poses[-1:], returns_to_range=True)
            qs = np.vstack([qs, further_qs])
            is_solved = np.append(is_solved, is_further_solved)
        if not is_solved.any():
            raise self._make_unreachable_error(poses[-1].position)
        qs = self._remove_turns(self._select_different(qs[is_solved]), seed)
        is_inside = self.joint_range.without_last().contains(qs[:, :-1])
        qs = qs[is_inside] if is_inside.any() else qs
        qs_by_pose = [*(self._move(qs, [pose]) for pose in poses[:-1]), qs]
        return np.array(qs_by_pose), [tuple(q) for q in qs.tolist()]

    def _make_unreachable_error(self, position: Array) -> Unreachable:
        shoulder = self.offsets[0].position
        reach = self.chain.reach + float(self._X_FT.position[2])
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

    def _find_starts(self, X_WT: Pose, q_seed: Array, angle_step: float) -> Array:
        """Return configurations `(B, n)` [rad] with the tool near a pose, and `q_seed`.

        In all configurations of a table, the tool is in the xz plane of the first joint; a turn of this joint
        brings it to the azimuth of the pose.
        """
        X_1T = self.offsets[0].inverse() @ X_WT
        x, y, z = X_1T.position.tolist()
        azimuth = math.atan2(y, x)
        direction = rotate_about_z(-azimuth) @ X_1T.rotation[:, 2]
        table_qs, places, cells = self._get_table(*np.round(direction / DIRECTION_STEP).tolist())
        distances = (places[0] - math.hypot(x, y)) ** 2 + (places[1] - z) ** 2
        count = START_COUNTS[self._size][int(angle_step <= MAX_FINE_ANGLE_STEP)]
        nearest = np.argsort(distances)[:count]
        start_qs = table_qs[nearest[np.unique(cells[nearest], return_index=True)[1]]]
        start_qs[:, 0] += azimuth
        return np.vstack([q_seed, start_qs])

    def _make_table(self, *direction: float) -> tuple[Array, Array, NDArray[np.int_]]:
        """Return a table of configurations with one direction of the tool axis.

        The direction, in multiples of `DIRECTION_STEP`, is in the frame of the first joint at position 0.

        Returns:
            The configurations `(N, n)` [rad], x and z of the tool in the same frame `(2, N)` [m], and the
            number of the cell of each configuration `(N,)`.
        """
        lower = self.joint_range.lower
        upper = np.minimum(self.joint_range.upper, lower + math.tau)
        start_qs = np.random.default_rng(0).uniform(lower, upper, (TABLE_SIZE, self._joint_count))
        rotation = self.offsets[0].rotation @ align_z(np.array(direction))
        tcps, _ = self.compute_tcps_and_axes(start_qs)
        qs, is_solved = self._approach(start_qs, [Pose(rotation, tcp) for tcp in tcps], SEARCH_STEP_COUNT)
        qs = self._remove_turns(qs[is_solved], np.zeros(self._joint_count))
        qs = qs[np.all(self.joint_range.compute_excess(qs)[:, 1:-1] < MAX_START_EXCESS, axis=1)]
        x, y, z = self.offsets[0].inverse().apply(self.compute_tcps_and_axes(qs)[0]).T
        qs[:, 0] -= np.arctan2(y, x)
        cells = np.floor(wrap_angles(qs[:, :-1]) / CELL_SIZES[self._size])
        return qs, np.array([np.hypot(x, y), z]), np.unique(cells, axis=0, return_inverse=True)[1].ravel()

    def _select_different(self, qs: Array) -> Array:
        """Return the first of equal configurations `(B, n)` [rad], without regard to the last joint."""
        points = np.hstack([np.cos(qs[:, :-1]), np.sin(qs[:, :-1])]) / (4 * SAME_SOLUTION_TOLERANCE)
        _, first = np.unique(np.round(points), axis=0, return_index=True)
        return qs[np.sort(first)]

    def _move(self, qs: Array, poses: Sequence[Pose]) -> Array:
        """Return configurations `(B, n)` [rad] after straight motions of the tool to `B` poses or to one.

        All motions begin in the same pose. A motion has several steps if a joint moves far in one step. A row
        is NaN if its motion is impossible.
        """
        moved_qs = self._step(qs, poses)
        rows = np.flatnonzero(np.isnan(moved_qs[:, 0]))
        if rows.size:
            ends = poses if len(poses) == 1 else [poses[row] for row in rows]
            start = self.compute_tool_pose(qs[0]).position
            lengths = [float(np.linalg.norm(end.position - start)) for end in ends]
            step_qs = qs[rows]
            for fraction in np.linspace(0.0, 1.0, 2 + int(max(lengths) / MAX_TOOL_STEP))[1:].tolist():
                poses = [Pose(end.rotation, start + fraction * (end.position - start)) for end in ends]
                step_qs = self._step(step_qs, poses)
            moved_qs[rows] = step_qs
        return moved_qs

    def _step(self, qs: Array, poses: Sequence[Pose]) -> Array:
        """Return the result of `_approach`, NaN if the pose is not reached or if a joint moves far."""
        next_qs, is_solved = self._approach(qs, poses)
        is_near = np.abs(next_qs - qs)[:, :-1].max(axis=1) <= MAX_JOINT_STEP
        return np.where((is_solved & is_near)[:, None], next_qs, np.nan)

    def _approach(
        self,
        start_qs: Array,
        poses: Sequence[Pose],
        step_count: int = MAX_STEP_COUNT,
        returns_to_range: bool = False,
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Move configurations `(B, n)` [rad] by Newton steps to `B` poses, or all to one pose.

        If `returns_to_range`, a redundant arm also moves joints that are out of their range back into it.

        Returns:
            The configurations, and the mask `(B,)` of those that reach their pose.
        """
        qs = start_qs.copy()
        is_solved = np.zeros(len(qs), dtype=bool)
        inner_range = self.joint_range.shrink(RANGE_MARGIN)
        rows = np.flatnonzero(~np.isnan(qs[:, 0]))
        # All vectors are in the frame of the goal. The frame `world` consists of three axes and the origin.
        rotations = np.array([pose.rotation for pose in poses]).reshape(-1, 3, 3)
        positions = np.array([pose.position for pose in poses]).reshape(-1, 3)
        world = np.empty((4, 3, len(qs)))
        world[:3] = rotations.transpose(1, 2, 0)
        world[3] = -np.einsum("bij,bi->jb", rotations, positions)
        for _ in range(step_count):
            if not rows.size:
                break
            (x, _, z, p), axes, origins = self._compute_frames(qs[rows], world[:, :, rows])
            error = -np.concatenate([p, z[:2]])
            levers = np.empty((len(axes), 2, 3, len(rows)))
            levers[:, 0] = p - origins
            levers[:, 1] = z
            jacobian = _cross(axes, levers).reshape(len(axes), 6, -1)[:, :5]
            change = _solve_least_squares(jacobian, error)
            if returns_to_range:
                way_back = (np.clip(qs[rows], *inner_range) - qs[rows])[:, :-1].T
                change += way_back
                change -= _solve_least_squares(jacobian, np.sum(jacobian * way_back[:, None], axis=0))
            change *= np.minimum(1.0, MAX_NEWTON_STEP / np.maximum(np.abs(change).max(axis=0), 1e-12))
            # The last joint turns the x axis of the tool to that of the goal; the other joints turn it, too.
            turn = -np.arctan2(x[1], x[0]) - np.sum(axes[:, 2] * change, axis=0)
            # Errors after the step: those of the linear model, and a bound of those that it neglects.
            remaining = np.abs(error - np.sum(jacobian * change[:, None], axis=0)).max(axis=0)
            remaining += np.abs(change).sum(axis=0) ** 2 + self._axis_error * np.abs(turn)
            qs[rows, :-1] += change.T
            qs[rows, -1] += self._turn_direction * turn
            is_solved[rows] = (remaining < self._max_error) & (z[2] > 0)
            rows = rows[(remaining >= MAX_ERROR) | (z[2] <= 0)]
        return qs, is_solved

    def _compute_frames(self, qs: Array, world: Array) -> tuple[Array, Array, Array]:
        """Return the frames of tool and joints at configurations `(B, n)` [rad].

        A frame `(4, 3, B)` consists of its axes and its origin [m]; `world` is that of the world.

        Returns:
            The frame of the tool, and axes and origins of the first n - 1 joints, `(n - 1, 3, B)` each.
        """
        angles = qs.T.copy(order="C")
        cosines = np.cos(angles)
        sines = np.sin(angles)
        axes_and_origins = np.empty((len(angles), 2, 3, len(qs)))
        frame = world
        for joint, (c, s) in enumerate(zip(cosines, sines, strict=True)):
            frame = (self._matrices[joint].T @ frame.reshape(4, -1)).reshape(world.shape)
            axes_and_origins[joint] = frame[2:]
            c_frame = c * frame[:2]
            s_frame = s * frame[:2]
            np.add(c_frame[0], s_frame[1], out=frame[0])
            np.subtract(c_frame[1], s_frame[0], out=frame[1])
        tool = (self._matrices[-1].T @ frame.reshape(4, -1)).reshape(world.shape)
        return tool, axes_and_origins[:-1, 0], axes_and_origins[:-1, 1]


def make_matrix(X: Pose) -> Array:
    """Return a pose as a homogeneous matrix `(4, 4)`."""
    matrix = np.eye(4)
    matrix[:3, :3] = X.rotation
    matrix[:3, 3] = X.position
    return matrix


def _cross(a: Array, b: Array) -> Array:
    """Return the vector products of vectors `a` `(m, 3, B)` and `b` `(m, K, 3, B)`; faster than np.cross."""
    products = np.empty_like(b)
    for row, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        products[:, :, row] = a[:, None, i] * b[:, :, j] - a[:, None, j] * b[:, :, i]
    return products


def _solve_least_squares(jacobian: Array, error: Array) -> Array:
    """Return the smallest joint changes `(m, B)` [rad] with `jacobian` `(m, 5, B)` for errors `(5, B)`."""
    JT = jacobian.transpose(2, 0, 1)
    J = JT.swapaxes(1, 2)
    e = error.T[:, :, None]
    if J.shape[2] < len(error):  # With fewer than six joints, the conditions depend on each other.
        change = np.linalg.solve(JT @ J + DAMPING * np.eye(J.shape[2]), JT @ e)
    else:
        change = JT @ np.linalg.solve(J @ JT + DAMPING * np.eye(len(error)), e)
    return np.asarray(change[:, :, 0].T)
