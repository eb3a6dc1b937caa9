"""Direct transcription of a motion as a quadratic program: each of `N` equal time steps has a constant jerk.

The steps take `h` seconds. The accelerations `a_0 ... a_N` at the ends of the steps change linearly within
the steps. With the scaled accelerations `y = a h²`, integration gives position `q`, velocity `v` and jerk `j`
of step `k`:

    v_k+1 h = v_k h + (y_k + y_k+1) / 2
    q_k+1 = q_k + v_k h + y_k / 3 + y_k+1 / 6
    j_k h³ = y_k+1 - y_k

All terms are linear in `y` and `h`, so that the dynamics are exact. The maximum acceleration `A` and the
maximum jerk `J` limit `y` to `A h²` and its differences to `J h³`. Both limits are convex in `h`; their
tangents replace them as lower bounds, so that no solution exceeds a limit. Distances from obstacles are
linearized in the joint positions. The solution is the fastest motion near the last motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import daqp
import numpy as np
from numpy.typing import NDArray

from executive.geometry import Array
from executive.motion.joints import JointLimits, JointState

STEP_COUNT = 8
"""Number of time steps of a motion."""
SAMPLES_PER_STEP = 12
"""Number of joint positions per time step at which distances are evaluated."""
SAMPLE_FRACTIONS = np.arange(1, STEP_COUNT * SAMPLES_PER_STEP) / (STEP_COUNT * SAMPLES_PER_STEP)
"""Times of the samples as fractions of the duration `(M,)`, without start and end."""
USED_LIMIT_FRACTIONS = 0.98, 0.995, 0.995
"""Used fractions of the velocity, acceleration and jerk limits.

Velocities are limited at the half steps; between half steps, a velocity may rise by up to `j (h / 2)² / 8`.
"""
VIOLATION_COST = 20.0
"""Cost of a violated constraint, as a duration per distance [s/m]."""
EXTRA_DISTANCE = 1e-3
"""Addition to the required distances in quadratic programs, because linearized distances have errors [m]."""
SMOOTHNESS_WEIGHT = 1e-4
"""Weight of the squared accelerations (as fractions of their limits), which makes the solution unique [s]."""
MIN_STEP_FACTOR = 0.8
"""Minimum factor on the duration of the motion in one quadratic program."""
MAX_STEP_FACTOR = 1.6
"""Maximum factor on the duration of the motion in one quadratic program."""
_VIOLATION_UNIT = 0.01  # [m]
_UNBOUNDED = 1e30  # bound that daqp treats as infinite
_STATUS_SOLVED, _EQUALITY_CONSTRAINT = 1, 5  # constants of daqp


class DiscreteMotion(NamedTuple):
    """A motion in `STEP_COUNT` time steps.

    Attributes:
        step: Duration of a time step [s].
        accelerations: Accelerations at the ends of the time steps `(n, STEP_COUNT + 1)` [rad/s²].
        qs: Joint positions at `SAMPLE_FRACTIONS` `(M, n)` [rad].
    """

    step: float
    accelerations: Array
    qs: Array

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return STEP_COUNT * self.step


class LinearizedConstraints(NamedTuple):
    """`R` inequality constraints `slack >= 0`, linearized about a motion.

    Attributes:
        slack: Slack of each constraint in the motion `(R,)` [m].
        samples: Indices of the `K` samples on which each constraint depends `(R, K)`.
        gradients: Derivatives of the slack by the joint positions at the samples `(R, K, n)` [m/rad].
        step_derivatives: Derivatives of the slack by the duration of a time step `(R,)` [m/s].
    """

    slack: Array
    samples: NDArray[np.intp]
    gradients: Array
    step_derivatives: Array


class Transcription:
    """Quadratic programs for motions between two states.

    The variables are the inner values `y_1 ... y_N-1` of all joints (in units of their limits), the duration
    `h` of a time step (in units of its last value), and the largest violation of a constraint
    (`_VIOLATION_UNIT`). The values `y_0` and `y_N` are given by the states.

    Args:
        start: State at the start of the motion.
        end: State at the end of the motion.
        limits: Joint limits.
    """

    def __init__(self, start: JointState, end: JointState, limits: JointLimits) -> None:
        self._start, self._end = start, end
        self._grid = grid = _build_grid(limits.joint_count)
        self._inner_count = limits.joint_count * (STEP_COUNT - 1)
        velocity_fraction, acceleration_fraction, jerk_fraction = USED_LIMIT_FRACTIONS
        max_velocity, max_jerk = velocity_fraction * limits.velocity, jerk_fraction * limits.jerk
        self._max_acceleration = acceleration_fraction * limits.acceleration
        half_velocity, velocity_count = grid.half_velocity, len(grid.half_velocity)
        acceleration_count, jerk_count = self._inner_count, limits.joint_count * STEP_COUNT
        jerk_ends = np.zeros((limits.joint_count, STEP_COUNT))
        jerk_ends[:, 0] -= start.qdd
        jerk_ends[:, -1] += end.qdd
        velocity_ends = np.outer(start.qdd, half_velocity[:, 0]) + np.outer(end.qdd, half_velocity[:, -1])
        # Each row limits the absolute value of `row y + linear h + quadratic h²` to
        # `bound[0] h + bound[1] h² + bound[2] h³`. The rows limit accelerations, velocities, and jerks.
        self._linear = np.pad(np.repeat(start.qd, velocity_count), (acceleration_count, jerk_count))
        self._quadratic = np.pad(np.append(velocity_ends, jerk_ends), (acceleration_count, 0))
        self._bound = np.zeros((3, len(self._linear)))
        self._bound[1, :acceleration_count] = np.repeat(self._max_acceleration, STEP_COUNT - 1)
        self._bound[0, acceleration_count:-jerk_count] = np.repeat(max_velocity, velocity_count)
        self._bound[2, -jerk_count:] = np.repeat(max_jerk, STEP_COUNT)

    def compute_states(self, motion: DiscreteMotion) -> list[JointState]:
        """Return the states of a motion at all half steps, including the start and the end."""
        h, start = motion.step, self._start
        y = motion.accelerations * h**2
        qd = start.qd + (self._grid.half_velocity @ y.T) / h
        qdd = np.empty((2 * STEP_COUNT - 1, len(y)))
        qdd[::2] = ((y[:, :-1] + y[:, 1:]) / 2).T / h**2  # middle of the steps
        qdd[1::2] = motion.accelerations[:, 1:-1].T
        half_steps = slice(SAMPLES_PER_STEP // 2 - 1, None, SAMPLES_PER_STEP // 2)
        return [start, *map(JointState, motion.qs[half_steps], qd, qdd), self._end]

    def fit(self, step: float, qs: Array) -> DiscreteMotion | None:
        """Return the motion with time steps of `step` [s] that is nearest to `qs` `(M, n)` [rad], or None."""
        program, inner_count = self._build_program(step), self._inner_count
        position_map = self._grid.sample_position[:, 1:-1]
        residual = qs - self._start.q - self._compute_end_terms(step)
        scale = program.scale[:inner_count]
        squares = np.kron(np.eye(len(self._max_acceleration)), position_map.T @ position_map)
        program.hessian[:inner_count, :inner_count] += scale[:, None] * squares * scale
        program.gradient[:inner_count] = -(position_map.T @ residual).T.ravel() * scale
        program.lower[inner_count] = program.upper[inner_count] = 1.0
        return self._solve(step, program, np.empty((0, inner_count + 2)), np.empty(0))

    def shorten(
        self, last_motion: DiscreteMotion, constraints: Sequence[LinearizedConstraints], trust_radius: float
    ) -> DiscreteMotion | None:
        """Return the fastest motion near the last motion, with small violations; None without a solution.

        Args:
            last_motion: Motion about which the constraints are linearized.
            constraints: Groups of constraints; a violation has the cost `VIOLATION_COST`.
            trust_radius: Maximum change of an acceleration as a fraction of its limit.
        """
        step, start, inner_count = last_motion.step, self._start, self._inner_count
        program = self._build_program(step)
        program.gradient[inner_count:] = STEP_COUNT * step, VIOLATION_COST * _VIOLATION_UNIT
        last_values = (last_motion.accelerations[:, 1:-1] / self._max_acceleration[:, None]).ravel()
        program.lower[:inner_count] = last_values - trust_radius
        program.upper[:inner_count] = last_values + trust_radius
        end_accelerations = np.stack([start.qdd, self._end.qdd])
        row_groups, row_uppers = [], []
        # Axes of the arrays: r constraint, k sample, j joint, i inner value, e start or end.
        for group in constraints:
            position_map, gradients = self._grid.sample_position[group.samples], group.gradients
            quadratic = np.einsum("rke,rkj,ej->r", position_map[:, :, [0, -1]], gradients, end_accelerations)
            linear = np.einsum("rkj,j,rk->r", gradients, start.qd, self._grid.sample_times[group.samples])
            rows = np.empty((len(gradients), inner_count + 2))
            value_gradients = np.einsum("rkj,rki->rji", gradients, position_map[:, :, 1:-1])
            rows[:, :inner_count] = -value_gradients.reshape(-1, inner_count)
            rows[:, inner_count] = -linear - 2 * step * quadratic - group.step_derivatives
            rows[:, inner_count + 1] = -1.0
            row_groups.append(rows)
            offset = np.einsum("rkj,rkj->r", gradients, start.q - last_motion.qs[group.samples])
            slack = group.slack - EXTRA_DISTANCE + offset
            row_uppers.append(slack - step**2 * quadratic - step * group.step_derivatives)
        return self._solve(step, program, np.concatenate(row_groups), np.concatenate(row_uppers))

    def _build_program(self, step: float) -> _Program:
        """Return the program without distance constraints, linearized about time steps of `step` [s]."""
        grid, start, end, h_column = self._grid, self._start, self._end, self._inner_count
        # The powers h, h², h³ are replaced by their tangents `slope h + offset`.
        slopes, offsets = np.array([1.0, 2 * step, 3 * step**2]), np.array([0.0, -(step**2), -2 * step**3])
        bound_slope, bound_offset = slopes @ self._bound, offsets @ self._bound
        slope, offset = self._linear + 2 * step * self._quadratic, step**2 * self._quadratic
        rows, limit_count, joint_count = grid.rows.copy(), len(bound_slope), len(start.q)
        rows[:limit_count, h_column] = slope - bound_slope
        rows[limit_count : 2 * limit_count, h_column] = -slope - bound_slope
        end_accelerations = np.stack([start.qdd, end.qdd])
        velocity_change = (grid.velocity[-1, [0, -1]][:, None] * end_accelerations).sum(axis=0)
        position_change = (grid.position[-1, [0, -1]][:, None] * end_accelerations).sum(axis=0)
        rows[2 * limit_count : -joint_count, h_column] = start.qd - end.qd + 2 * step * velocity_change
        rows[-joint_count:, h_column] = STEP_COUNT * start.qd + 2 * step * position_change
        row_lower = np.full(len(rows), -_UNBOUNDED)
        row_upper = np.concatenate(
            [
                bound_offset + offset, bound_offset - offset, step**2 * velocity_change,
                end.q - start.q + step**2 * position_change,
            ]
        )  # fmt: skip
        row_lower[2 * limit_count :] = row_upper[2 * limit_count :]
        lower, upper = np.full(h_column + 2, -_UNBOUNDED), np.full(h_column + 2, _UNBOUNDED)
        lower[h_column:], upper[h_column] = (MIN_STEP_FACTOR, 0.0), MAX_STEP_FACTOR
        scale = np.repeat(self._max_acceleration * step**2, STEP_COUNT - 1)
        scale = np.append(scale, [step, _VIOLATION_UNIT])
        hessian, gradient = SMOOTHNESS_WEIGHT * np.eye(h_column + 2), np.zeros(h_column + 2)
        return _Program(scale, hessian, gradient, rows, lower, upper, row_lower, row_upper, 2 * joint_count)

    def _compute_end_terms(self, step: float) -> Array:
        """Return the terms of `v_0`, `y_0` and `y_N` in the sampled positions `(M, n)` [rad]."""
        position_map, start, end = self._grid.sample_position, self._start, self._end
        quadratic = np.outer(position_map[:, 0], start.qdd) + np.outer(position_map[:, -1], end.qdd)
        return np.outer(self._grid.sample_times, start.qd * step) + step**2 * quadratic

    def _solve(
        self, step: float, program: _Program, extra_rows: Array, extra_upper: Array
    ) -> DiscreteMotion | None:
        """Return the motion that solves a program with extra rows, or None if there is no solution."""
        solution = program.solve(extra_rows, extra_upper)
        if solution is None:
            return None
        h = step * float(solution[self._inner_count])
        inner_values = (solution * program.scale)[: self._inner_count].reshape(-1, STEP_COUNT - 1)
        y = np.column_stack([self._start.qdd * h**2, inner_values, self._end.qdd * h**2])
        grid = self._grid
        qs = self._start.q + np.outer(grid.sample_times, self._start.qd * h) + grid.sample_position @ y.T
        return DiscreteMotion(h, y / h**2, qs)


class _Program(NamedTuple):
    """A quadratic program with `V` variables and `R` rows: minimize `x hessian x / 2 + gradient x`.

    The constraints are `lower <= x <= upper` and `row_lower <= rows (scale x) <= row_upper`.

    Attributes:
        scale: Units of the variables `x` `(V,)`.
        hessian: Quadratic cost `(V, V)`.
        gradient: Linear cost `(V,)`.
        rows: Coefficients of the constraints `(R, V)`.
        lower, upper: Bounds of the variables `(V,)`.
        row_lower, row_upper: Bounds of the rows `(R,)`.
        equality_count: Number of equality constraints, which are the last rows.
    """

    scale: Array
    hessian: Array
    gradient: Array
    rows: Array
    lower: Array
    upper: Array
    row_lower: Array
    row_upper: Array
    equality_count: int

    def solve(self, extra_rows: Array, extra_upper: Array) -> Array | None:
        """Return the solution `(V,)` with `extra_rows (scale x) <= extra_upper`, or None if there is none."""
        rows = np.concatenate([extra_rows, self.rows])
        row_lower = np.concatenate([np.full(len(extra_upper), -_UNBOUNDED), self.row_lower])
        row_upper = np.concatenate([extra_upper, self.row_upper])
        constraint_types = np.zeros(len(self.lower) + len(rows), dtype=np.int32)
        constraint_types[-self.equality_count :] = _EQUALITY_CONSTRAINT
        solution, _, status, _ = daqp.solve(
            self.hessian, self.gradient, np.ascontiguousarray(rows * self.scale),
            np.concatenate([self.upper, row_upper]), np.concatenate([self.lower, row_lower]),
            constraint_types,
        )  # fmt: skip
        return np.asarray(solution) if status == _STATUS_SOLVED else None


class _Grid(NamedTuple):
    """Linear maps from the `STEP_COUNT + 1` values `y` of a joint to its states, and the rows of a program.

    Attributes:
        velocity: Map to the velocities at the ends of the steps `(STEP_COUNT + 1, STEP_COUNT + 1)`.
        position: Map to the positions at the ends of the steps `(STEP_COUNT + 1, STEP_COUNT + 1)`.
        half_velocity: Map to the velocities at the inner half steps `(2 STEP_COUNT - 1, STEP_COUNT + 1)`.
        sample_position: Map to the positions at `SAMPLE_FRACTIONS` `(M, STEP_COUNT + 1)`.
        sample_times: Times of the samples [steps] `(M,)`.
        rows: Rows for all limits, for the negated limits, and for the final state; the last two columns, for
            step and violation, are 0.
    """

    velocity: Array
    position: Array
    half_velocity: Array
    sample_position: Array
    sample_times: Array
    rows: Array


@lru_cache(maxsize=4)
def _build_grid(joint_count: int) -> _Grid:
    """Return the grid, with the factors of the integrals in the module docstring over steps of time 1.

    Over a part `f` of a step, `v f`, `y_k (f² / 2 - f³ / 6)` and `y_k+1 f³ / 6` add up to the position, and
    `y_k (f - f² / 2)` and `y_k+1 f² / 2` to the velocity.
    """
    velocity, position = np.zeros((2, STEP_COUNT + 1, STEP_COUNT + 1))
    for k in range(STEP_COUNT):
        velocity[k + 1], position[k + 1] = velocity[k], position[k] + velocity[k]
        velocity[k + 1, k : k + 2] += 1 / 2
        position[k + 1, k : k + 2] += 1 / 3, 1 / 6
    sample_times = np.asarray(STEP_COUNT * SAMPLE_FRACTIONS)
    step = sample_times.astype(int)
    f = sample_times - step
    sample_position = position[step] + f[:, None] * velocity[step]
    sample = np.arange(len(sample_times))
    sample_position[sample, step] += f**2 / 2 - f**3 / 6
    sample_position[sample, step + 1] += f**3 / 6
    half_velocity = np.empty((2 * STEP_COUNT - 1, STEP_COUNT + 1))
    half_velocity[1::2] = velocity[1:-1]
    half_velocity[::2] = velocity[:-1]
    for k in range(STEP_COUNT):
        half_velocity[2 * k, k : k + 2] += 3 / 8, 1 / 8
    joints = np.eye(joint_count)
    accelerations, jerks = np.eye(STEP_COUNT + 1)[1:-1], np.diff(np.eye(STEP_COUNT + 1), axis=0)
    limits = [np.kron(joints, rows[:, 1:-1]) for rows in (accelerations, half_velocity, jerks)]
    final_state = [np.kron(joints, row[-1, 1:-1]) for row in (velocity, position)]
    rows = np.concatenate([*limits, *(-limit for limit in limits), *final_state])
    rows = np.pad(rows, ((0, 0), (0, 2)))
    return _Grid(velocity, position, half_velocity, sample_position, sample_times, rows)
