"""Direct transcription of a motion as a quadratic program: each of `N` equal time steps has a constant jerk.

With steps of `h` seconds and accelerations `a_0 ... a_N` that change linearly within the steps, velocities,
positions and jerks are linear in `y = a h²` and in `h` times the initial velocity:

    v_k h = v_0 h + sum of (y_i + y_i+1) / 2,   q_k = q_0 + k v_0 h + double sum of y,   j_k h³ = y_k+1 - y_k

So dynamics and final state are exact. The acceleration limits `A h²` and jerk limits `J h³` are convex in
`h`. Their tangents, which are lower bounds, replace the limits, so that no solution exceeds a limit.
Distances from obstacles are linearized in the joint positions. The solution is the fastest motion near the
last motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import daqp
import numpy as np
from numpy.typing import NDArray

from executive.geometry import Array
from executive.motion.limits import JointLimits
from executive.motion.state import JointState

STEP_COUNT = 8
"""Number of time steps of a motion."""
SAMPLES_PER_STEP = 16
"""Number of joint positions per time step at which distances are evaluated."""
SAMPLE_FRACTIONS = np.arange(1, STEP_COUNT * SAMPLES_PER_STEP) / (STEP_COUNT * SAMPLES_PER_STEP)
"""Times of the samples as fractions of the duration `(M,)`, without start and end."""
USED_LIMIT_FRACTIONS = 0.98, 0.995, 0.995
"""Used fractions of the velocity, acceleration and jerk limits.

Velocities are limited at every half step; between them, a velocity may be higher by `j (h / 2)² / 8`.
"""
VIOLATION_COST = 20.0
"""Cost of a violated constraint, as a duration per distance [s/m]."""
EXTRA_DISTANCE = 1e-3
"""Addition to the required distances in a program, because linearized distances have an error [m]."""
SMOOTHNESS_WEIGHT = 1e-4
"""Weight of the squared accelerations (as fractions of their limits), which makes the solution unique [s]."""
MIN_STEP_FACTOR = 0.8
"""Minimum factor on the duration of the motion in one program."""
MAX_STEP_FACTOR = 1.6
"""Maximum factor on the duration of the motion in one program."""
_DISTANCE_UNIT = 0.01  # [m]
_UNBOUNDED = 1e30
_SOLVED, _EQUALITY = 1, 5  # constants of daqp


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
        rows: Indices of the `K` samples on which each constraint depends `(R, K)`.
        gradients: Derivatives of the slack by the joint positions at these samples `(R, K, n)` [m/rad].
        step_derivatives: Derivatives by the duration of a time step at constant positions `(R,)` [m/s].
    """

    slack: Array
    rows: NDArray[np.intp]
    gradients: Array
    step_derivatives: Array


class Transcription:
    """Quadratic programs for motions between two states.

    The variables are the values `y` of all joints without start and end (in units of their limits), the
    duration `h` of a time step (in units of its last value), and the violation [_DISTANCE_UNIT].

    Args:
        start, end: States at both ends of the motion.
        limits: Joint limits.
    """

    def __init__(self, start: JointState, end: JointState, limits: JointLimits) -> None:
        self._start, self._end = start, end
        self._grid = grid = _build_grid(limits.joint_count)
        self._inner_count = limits.joint_count * (STEP_COUNT - 1)
        velocity, self._acceleration, jerk = (
            fraction * limit
            for fraction, limit in zip(
                USED_LIMIT_FRACTIONS, (limits.velocity, limits.acceleration, limits.jerk), strict=True
            )
        )
        velocity_count, acceleration_count = len(grid.half_velocity), len(grid.accelerations)
        jerk_count = len(grid.jerks)
        jerk_ends = np.zeros((limits.joint_count, STEP_COUNT))
        jerk_ends[:, 0] -= start.qdd
        jerk_ends[:, -1] += end.qdd
        half_velocity = grid.half_velocity
        velocity_ends = np.outer(start.qdd, half_velocity[:, 0]) + np.outer(end.qdd, half_velocity[:, -1])
        # Each row limits the absolute value of `row y + linear h + quadratic h²` to
        # `bound[0] h + bound[1] h² + bound[2] h³`.
        self._linear = np.concatenate(
            [np.zeros(acceleration_count), np.repeat(start.qd, velocity_count), np.zeros(jerk_count)]
        )
        self._quadratic = np.concatenate(
            [np.zeros(acceleration_count), velocity_ends.ravel(), jerk_ends.ravel()]
        )
        self._bound = np.zeros((3, len(self._linear)))
        self._bound[1, :acceleration_count] = np.repeat(self._acceleration, STEP_COUNT - 1)
        self._bound[0, acceleration_count:-jerk_count] = np.repeat(velocity, velocity_count)
        self._bound[2, -jerk_count:] = np.repeat(jerk, STEP_COUNT)

    def compute_states(self, motion: DiscreteMotion) -> list[JointState]:
        """Return the states at all half steps, including the start and the end."""
        h, grid, start = motion.step, self._grid, self._start
        y = motion.accelerations * h**2
        qd = start.qd + (grid.half_velocity @ y.T) / h
        qdd = np.empty((2 * STEP_COUNT - 1, len(y)))
        qdd[::2], qdd[1::2] = ((y[:, :-1] + y[:, 1:]) / 2).T / h**2, motion.accelerations[:, 1:-1].T
        half_steps = slice(SAMPLES_PER_STEP // 2 - 1, None, SAMPLES_PER_STEP // 2)
        return [start, *map(JointState, motion.qs[half_steps], qd, qdd), self._end]

    def fit(self, step: float, qs: Array) -> DiscreteMotion | None:
        """Return the motion with time steps of `step` [s] that is nearest to `qs` `(M, n)` [rad], or None."""
        program, inner_count = self._build_program(step), self._inner_count
        inner = self._grid.sample_position[:, 1:-1]
        residual = qs - self._start.q - self._compute_end_terms(step)
        scale = program.scale[:inner_count]
        program.hessian[:inner_count, :inner_count] += (
            scale[:, None] * np.kron(np.eye(len(self._acceleration)), inner.T @ inner) * scale
        )
        program.gradient[:inner_count] = -(inner.T @ residual).T.ravel() * scale
        program.low[inner_count] = program.high[inner_count] = 1.0
        return self._solve(step, program)

    def shorten(
        self, last: DiscreteMotion, constraints: Sequence[LinearizedConstraints], trust_radius: float
    ) -> DiscreteMotion | None:
        """Return the fastest motion near the last motion, with small violations, or None if there is none.

        Args:
            last: Motion about which the constraints are linearized.
            constraints: Constraints, whose violation has the cost `VIOLATION_COST`.
            trust_radius: Maximum change of an acceleration as a fraction of its limit.
        """
        step, start, inner_count = last.step, self._start, self._inner_count
        program = self._build_program(step)
        program.gradient[inner_count:] = STEP_COUNT * step, VIOLATION_COST * _DISTANCE_UNIT
        before = (last.accelerations[:, 1:-1] / self._acceleration[:, None]).ravel()
        program.low[:inner_count], program.high[:inner_count] = before - trust_radius, before + trust_radius
        ends = np.stack([start.qdd, self._end.qdd])
        rows, upper_bounds = [], []
        for group in constraints:
            position, gradients = self._grid.sample_position[group.rows], group.gradients
            quadratic = np.einsum("rke,rkj,ej->r", position[:, :, [0, -1]], gradients, ends)
            linear = np.einsum("rkj,j,rk->r", gradients, start.qd, self._grid.sample_times[group.rows])
            block = np.empty((len(gradients), inner_count + 2))
            inner = np.einsum("rkj,rki->rji", gradients, position[:, :, 1:-1])
            block[:, :inner_count] = -inner.reshape(-1, inner_count)
            block[:, inner_count] = -linear - 2 * step * quadratic - group.step_derivatives
            block[:, inner_count + 1] = -1.0
            rows.append(block)
            offset = np.einsum("rkj,rkj->r", gradients, start.q - last.qs[group.rows])
            slack = group.slack - EXTRA_DISTANCE + offset
            upper_bounds.append(slack - step**2 * quadratic - step * group.step_derivatives)
        return self._solve(step, program, np.concatenate(rows), np.concatenate(upper_bounds))

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
        row_low = np.full(len(rows), -_UNBOUNDED)
        row_high = np.concatenate(
            [
                bound_offset + offset, bound_offset - offset, step**2 * velocity_change,
                end.q - start.q + step**2 * position_change,
            ]
        )  # fmt: skip
        row_low[2 * limit_count :] = row_high[2 * limit_count :]
        low, high = np.full(h_column + 2, -_UNBOUNDED), np.full(h_column + 2, _UNBOUNDED)
        low[h_column:], high[h_column] = (MIN_STEP_FACTOR, 0.0), MAX_STEP_FACTOR
        scale = np.concatenate(
            [np.repeat(self._acceleration * step**2, STEP_COUNT - 1), [step, _DISTANCE_UNIT]]
        )
        hessian, gradient = SMOOTHNESS_WEIGHT * np.eye(h_column + 2), np.zeros(h_column + 2)
        return _Program(scale, hessian, gradient, rows, low, high, row_low, row_high, 2 * joint_count)

    def _compute_end_terms(self, step: float) -> Array:
        """Return the terms of all samples `(M, n)` [rad] due to the states at start and end."""
        position, start, end = self._grid.sample_position, self._start, self._end
        quadratic = np.outer(position[:, 0], start.qdd) + np.outer(position[:, -1], end.qdd)
        return np.outer(self._grid.sample_times, start.qd * step) + step**2 * quadratic

    def _solve(
        self, step: float, program: _Program, rows: Array | None = None, upper_bounds: Array | None = None
    ) -> DiscreteMotion | None:
        """Return the solution of a program with additional rows, or None if there is none."""
        solution = program.solve(rows, upper_bounds)
        if solution is None:
            return None
        h = step * float(solution[self._inner_count])
        inner = (solution * program.scale)[: self._inner_count].reshape(-1, STEP_COUNT - 1)
        y = np.column_stack([self._start.qdd * h**2, inner, self._end.qdd * h**2])
        grid = self._grid
        qs = self._start.q + np.outer(grid.sample_times, self._start.qd * h) + grid.sample_position @ y.T
        return DiscreteMotion(h, y / h**2, qs)


class _Program(NamedTuple):
    """A quadratic program: minimize `x hessian x / 2 + gradient x`.

    The constraints are `low <= x <= high` and `row_low <= rows (scale x) <= row_high`.

    Attributes:
        scale: Units of the variables `x`.
        equality_count: Number of equality constraints, which are the last rows.
    """

    scale: Array
    hessian: Array
    gradient: Array
    rows: Array
    low: Array
    high: Array
    row_low: Array
    row_high: Array
    equality_count: int

    def solve(self, more_rows: Array | None, upper_bounds: Array | None) -> Array | None:
        """Return the solution, or None if there is none; `upper_bounds` limit the values of `more_rows`."""
        rows, row_low, row_high = self.rows, self.row_low, self.row_high
        if more_rows is not None and upper_bounds is not None:
            rows = np.concatenate([more_rows, rows])
            row_low = np.concatenate([np.full(len(upper_bounds), -_UNBOUNDED), row_low])
            row_high = np.concatenate([upper_bounds, row_high])
        senses = np.zeros(len(self.low) + len(rows), dtype=np.int32)
        senses[-self.equality_count :] = _EQUALITY
        solution, _, status, _ = daqp.solve(
            self.hessian, self.gradient, np.ascontiguousarray(rows * self.scale),
            np.concatenate([self.high, row_high]), np.concatenate([self.low, row_low]), senses,
        )  # fmt: skip
        return np.asarray(solution) if status == _SOLVED else None


class _Grid(NamedTuple):
    """Linear maps from the `STEP_COUNT + 1` values `y` of a joint to its states, and the rows of a program.

    Attributes:
        velocity, position: Maps to these states at the ends of the steps `(STEP_COUNT + 1, STEP_COUNT + 1)`.
        half_velocity: Map to the velocities at the inner half steps `(2 STEP_COUNT - 1, STEP_COUNT + 1)`.
        sample_position: Map to the positions at `SAMPLE_FRACTIONS` `(M, STEP_COUNT + 1)`.
        sample_times: Times of the samples [steps] `(M,)`.
        accelerations, jerks: Maps from the inner values of all joints to accelerations and jerks.
        rows: Rows of all limits, of the negated limits, and of the final state; the last two columns, for
            step and violation, are 0.
    """

    velocity: Array
    position: Array
    half_velocity: Array
    sample_position: Array
    sample_times: Array
    accelerations: Array
    jerks: Array
    rows: Array


@lru_cache(maxsize=4)
def _build_grid(joint_count: int) -> _Grid:
    velocity, position = np.zeros((2, STEP_COUNT + 1, STEP_COUNT + 1))
    for k in range(STEP_COUNT):
        velocity[k + 1], position[k + 1] = velocity[k], position[k] + velocity[k]
        velocity[k + 1, k : k + 2] += 1 / 2
        position[k + 1, k : k + 2] += 1 / 3, 1 / 6
    sample_times = np.asarray(STEP_COUNT * SAMPLE_FRACTIONS)
    step = sample_times.astype(int)
    fraction = sample_times - step
    sample_position = position[step] + fraction[:, None] * velocity[step]
    sample = np.arange(len(sample_times))
    sample_position[sample, step] += fraction**2 / 2 - fraction**3 / 6
    sample_position[sample, step + 1] += fraction**3 / 6
    half_velocity = np.empty((2 * STEP_COUNT - 1, STEP_COUNT + 1))
    half_velocity[1::2] = velocity[1:-1]
    half_velocity[::2] = velocity[:-1]
    for k in range(STEP_COUNT):
        half_velocity[2 * k, k : k + 2] += 3 / 8, 1 / 8
    joints = np.eye(joint_count)
    accelerations = np.asarray(np.kron(joints, np.eye(STEP_COUNT - 1)), dtype=np.float64)
    jerks = np.asarray(np.kron(joints, np.diff(np.eye(STEP_COUNT + 1), axis=0)[:, 1:-1]), dtype=np.float64)
    limits = np.concatenate([accelerations, np.kron(joints, half_velocity[:, 1:-1]), jerks])
    final_state = [np.kron(joints, velocity[-1, 1:-1]), np.kron(joints, position[-1, 1:-1])]
    rows = np.pad(np.concatenate([limits, -limits, *final_state]), ((0, 0), (0, 2)))
    return _Grid(velocity, position, half_velocity, sample_position, sample_times, accelerations, jerks, rows)
