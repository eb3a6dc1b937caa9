"""Solutions of the inverse kinematics of an arm, compared with those of an exhaustive search.

The exhaustive search is independent of all solvers: damped Newton steps on the whole pose error, from many
random configurations. A pose counts as reachable if the search finds a solution with every joint but the last
in its range; the last joint is left out, because most goals permit every yaw.

The solutions of a redundant arm are curves. A solution of the search on a curve counts as found if the solver
returns a solution next to it: at most `MAX_LAST_DIFFERENCE` away in the last joint, and at most
`MAX_DIFFERENCE` in the other joints.
"""

from __future__ import annotations

import contextlib
import math
import time

import numpy as np

from executive.arms.urdf import read_chain
from executive.cell.arm_config import ArmConfig, BaseConfig
from executive.cell.config import CellConfig
from executive.errors import Unreachable
from executive.geometry import Array, Pose, make_tool_down_pose, rotate_about_z
from executive.motion.configurations import COARSE_ANGLE_STEP, FINE_ANGLE_STEP
from executive.motion.joints import JointRange, Kinematics, build_planning_kinematics, wrap_angles
from tests.benchmarks.motion_scenes import replace_solver
from tests.benchmarks.report import Figures, run_command

STEP_COUNT = 40
"""Maximum number of steps of the exhaustive search."""
MAX_STEP = 0.6
"""Maximum change of a joint in a step of the exhaustive search [rad]."""
TOLERANCE = 1e-10
"""Error of a solution of the exhaustive search, [m] and [rad]."""
SAME_SOLUTION = 1e-3
"""Maximum difference in a joint of two equal solutions [rad]."""
SPACING = math.radians(3.0)
"""Distance between the solutions of the exhaustive search of a redundant arm [rad]."""
MAX_LAST_DIFFERENCE = math.radians(10.0)
"""Maximum difference in the last joint of neighbouring solutions of a redundant arm [rad]."""
MAX_DIFFERENCE = math.radians(40.0)
"""Maximum difference in the other joints of neighbouring solutions of a redundant arm [rad]."""
HEIGHTS = (0.0, 0.5)
"""Smallest and largest height of a pose above the table [m]."""
MIN_SHARE = 0.99
"""Minimum share of the solutions of the exhaustive search that a solver finds."""
MAX_ERROR = 1e-8
"""Maximum error of a solution: of the position [m] and of the rotation matrix."""


class ExhaustiveSearch:
    """Search for all solutions of a pose, from random configurations.

    Args:
        arm: The arm of a cell.
        tool_length: Distance from the flange to the tool centre point [m].
        joint_range: Range of the joints.
        starts: Number of random configurations.
    """

    def __init__(self, arm: ArmConfig, tool_length: float, joint_range: JointRange, starts: int) -> None:
        chain = read_chain(arm.urdf, arm.flange)
        base = Pose(rotate_about_z(math.radians(arm.base.yaw_deg)), np.array(arm.base.position))
        self._offsets = [base @ chain.offsets[0], *chain.offsets[1:]]
        self._X_nT = chain.X_nF @ Pose.of([0.0, 0.0, tool_length])
        self._range = joint_range.without_last()
        self._starts = starts
        self.max_radius = chain.reach + tool_length
        """Upper bound of the distance of the tool centre point from the axis of the first joint [m]."""

    def find_solutions(self, pose: Pose, random: np.random.Generator) -> Array:
        """Return different solutions `(B, n)` [rad] in the range of the joints."""
        all_qs = random.uniform(-math.pi, math.pi, (self._starts, len(self._offsets)))
        rows = np.arange(self._starts)
        for _ in range(STEP_COUNT):
            qs = all_qs[rows]
            error, jacobian = self.compute_errors(qs, pose)
            squares = np.sum(error**2, axis=1)[:, None, None]
            transposed = jacobian.swapaxes(1, 2)
            damped = jacobian @ transposed + (1e-3 * squares + 1e-15) * np.eye(6)
            change = (transposed @ np.linalg.solve(damped, error[:, :, None]))[:, :, 0]
            largest = np.abs(change).max(axis=1, keepdims=True)
            all_qs[rows] += change * np.minimum(1.0, MAX_STEP / np.maximum(largest, 1e-12))
            rows = rows[np.abs(error).max(axis=1) > TOLERANCE]
            if not len(rows):
                break
        qs = np.delete(all_qs, rows, axis=0)
        lower, upper = self._range
        angles = lower + (qs[:, :-1] - lower) % math.tau
        qs = np.hstack([angles, wrap_angles(qs[:, -1:])])[np.all(angles <= upper, axis=1)]
        spacing = SPACING if len(self._offsets) > 6 else SAME_SOLUTION
        different: list[Array] = []
        for q in qs:
            if not different or np.abs(wrap_angles(np.array(different) - q)).max(axis=1).min() > spacing:
                different.append(q)
        return np.array(different).reshape(-1, len(self._offsets))

    def compute_errors(self, qs: Array, pose: Pose) -> tuple[Array, Array]:
        """Return the pose errors `(B, 6)` [m, rad] of configurations `(B, n)` [rad], and the Jacobians."""
        X = Pose(np.broadcast_to(np.eye(3), (len(qs), 3, 3)), np.zeros((len(qs), 3)))
        axes = []
        origins = []
        for offset, angles in zip(self._offsets, qs.T, strict=True):
            p = X.position + X.rotation @ offset.position
            R = X.rotation @ offset.rotation
            axes.append(R[:, :, 2])
            origins.append(p)
            x = R[:, :, 0]
            y = R[:, :, 1]
            c = np.cos(angles)[:, None]
            s = np.sin(angles)[:, None]
            X = Pose(np.stack([c * x + s * y, c * y - s * x, R[:, :, 2]], axis=2), p)
        p = X.position + X.rotation @ self._X_nT.position
        R = X.rotation @ self._X_nT.rotation
        arms = p[None] - np.array(origins)
        jacobian = np.concatenate([np.cross(axes, arms), axes], axis=2).transpose(1, 2, 0)
        return np.hstack(
            [pose.position - p, compute_rotation_vectors(pose.rotation @ R.swapaxes(1, 2))]
        ), jacobian


def compute_rotation_vectors(rotations: Array) -> Array:
    """Return the rotation vectors `(B, 3)` [rad] of rotation matrices `(B, 3, 3)`."""
    skew = rotations - rotations.swapaxes(1, 2)
    sines = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1) / 2
    sine = np.linalg.norm(sines, axis=1)
    angle = np.arctan2(sine, (np.trace(rotations, axis1=1, axis2=2) - 1) / 2)
    return sines * (angle / np.maximum(sine, 1e-15))[:, None]


def measure(
    cell: CellConfig, solver: str | None = None, seed: int = 0, poses: int = 300, starts: int = 2000
) -> Figures:
    """Compare the solutions of the arm of CELL with those of an exhaustive search, for random poses in reach.

    The tool points down. `--solver` replaces the solver of the arm. The exhaustive search begins with
    `--starts` random configurations.
    """
    cell = replace_solver(cell, solver)
    kinematics = build_planning_kinematics(cell)
    search = ExhaustiveSearch(cell.arm, cell.tool.length, kinematics.joint_range, starts)
    random = np.random.default_rng(seed)
    home = np.radians(cell.arm.poses_deg["home"])
    find_solutions_in_range(kinematics, kinematics.compute_tool_pose(home), home)  # The first call is slower.
    rows: list[Figures] = []
    while sum(row["reachable"] for row in rows) < poses:
        pose = draw_pose(cell.arm.base, search.max_radius, random)
        expected = search.find_solutions(pose, random)
        began = time.thread_time()
        qs, angle_step = find_solutions_in_range(kinematics, pose, home)
        duration = (time.thread_time() - began) * 1e3
        errors = np.abs(search.compute_errors(qs, pose)[0])
        rows.append(
            {
                "reachable": len(expected) > 0,
                "solved": len(qs) > 0,
                "coarse": len(qs) > 0 and angle_step == COARSE_ANGLE_STEP,
                "expected": len(expected),
                "found": count_found(expected, qs),
                "returned": len(qs),
                "m": errors[:, :3].max(initial=0.0),
                "rad": errors[:, 3:].max(initial=0.0),
                "ms": duration,
            }
        )
    reachable = {
        key: np.array([row[key] for row in rows if row["reachable"]], dtype=float) for key in rows[0]
    }
    figures: Figures = {
        "cell": cell.cell,
        "solver": cell.arm.solver,
        "poses": len(rows),
        "reachable": poses,
        "seed": seed,
        "solved_share": reachable["solved"].mean(),
        "solved_in_first_search_share": reachable["coarse"].mean(),
        "found_share": reachable["found"].sum() / reachable["expected"].sum(),
        "missed_by_search": sum(row["solved"] and not row["reachable"] for row in rows),
        "solutions_median": float(np.median(reachable["returned"])),
        "position_error_m": reachable["m"].max(),
        "rotation_error_rad": reachable["rad"].max(),
        "time_median_ms": float(np.median(reachable["ms"])),
        "time_max_ms": reachable["ms"].max(),
    }
    limits = {"solved_share": 1.0, "found_share": MIN_SHARE}
    problems = [f"{key} below {limit:g}" for key, limit in limits.items() if figures[key] < limit]
    errors = ("position_error_m", "rotation_error_rad")
    problems += [f"{key} above {MAX_ERROR:g}" for key in errors if figures[key] > MAX_ERROR]
    return {**figures, "problems": problems}


def draw_pose(base: BaseConfig, max_radius: float, random: np.random.Generator) -> Pose:
    """Return a random pose in the reach of an arm, with the tool down."""
    radius = max_radius * math.sqrt(random.uniform())
    azimuth, yaw = random.uniform(-math.pi, math.pi, 2)
    place = base.position + radius * np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
    return make_tool_down_pose([*place[:2], random.uniform(*HEIGHTS)], yaw)


def find_solutions_in_range(kinematics: Kinematics, pose: Pose, seed: Array) -> tuple[Array, float]:
    """Return the solutions `(B, n)` [rad] in the range, and the angle step [rad] with which they were found.

    As in the planner, the second search follows only if the first one finds no solution in the range.
    """
    for angle_step in (COARSE_ANGLE_STEP, FINE_ANGLE_STEP):
        with contextlib.suppress(Unreachable):
            (qs,), _ = kinematics.solve_all([pose], seed, angle_step)
            qs = qs[kinematics.joint_range.without_last().contains(qs[:, :-1])]
            if len(qs):
                return qs, angle_step
    return np.empty((0, len(seed))), math.nan


def count_found(expected: Array, qs: Array) -> int:
    """Return the number of expected solutions `(E, n)` [rad] next to a returned solution `(B, n)` [rad]."""
    limits = np.full(expected.shape[1], SAME_SOLUTION)
    if len(limits) > 6:
        limits[:] = MAX_DIFFERENCE
        limits[-1] = MAX_LAST_DIFFERENCE
    return sum(bool(np.any(np.all(np.abs(wrap_angles(qs - q)) <= limits, axis=1))) for q in expected)


if __name__ == "__main__":
    run_command(measure)
