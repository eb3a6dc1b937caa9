"""Direct transcription of a motion as a quadratic program: jerks are constant over equal time steps.

With `N` steps of `h` seconds and accelerations `a_0 ... a_N` that change linearly in between, velocities,
positions and jerks are linear in `y = a h²` (and in `h` times the initial velocity):

    v_k h = v_0 h + sum of (y_i + y_i+1) / 2,   q_k = q_0 + k v_0 h + sums of the same,   j_k h³ = y_k+1 - y_k

So dynamics and final state are exact. The limits `A h²` and `J h³` are convex in `h`. Their tangents, which
lie below, replace them, so that no step exceeds a limit. Distances from obstacles are linearized in the joint
positions. The solution is the shortest motion near the last one.
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
"""Number of positions per time step at which distances are evaluated."""
SAMPLE_SHARES = np.arange(1, STEP_COUNT * SAMPLES_PER_STEP) / (STEP_COUNT * SAMPLES_PER_STEP)
"""Times of these positions as shares of the duration `(M,)`; start and end are not among them."""
USED_LIMIT_SHARES = 0.98, 0.995, 0.995
"""Used shares of the velocity, acceleration and jerk limits.

Velocities are limited at every half step `h / 2`; in between, a velocity may be higher by `j (h / 2)² / 8`.
"""
VIOLATION_COST = 20.0
"""Cost of a violated distance, as a duration [s/m]."""
EXTRA_DISTANCE = 1e-3
"""Distance beyond the required one in a program, because the linearized distance has an error [m]."""
SMOOTHNESS_WEIGHT = 1e-4
"""Weight of the squared accelerations (as shares of their limits), which make the solution unique [s]."""
MIN_STEP_CHANGE, MAX_STEP_CHANGE = 0.8, 1.6
"""Range of the factor on the duration in one solution."""
_DISTANCE_UNIT = 0.01  # [m]
_UNBOUNDED = 1e30
_SOLVED, _EQUALITY = 1, 5  # constants of daqp


class JointCourse(NamedTuple):
    """A motion in `STEP_COUNT` time steps.

    Attributes:
        step: Length of a step [s].
        accelerations: Accelerations at the ends of the steps `(n, STEP_COUNT + 1)` [rad/s²].
        qs: Joint positions at `SAMPLE_SHARES` `(M, n)` [rad].
    """

    step: float
    accelerations: Array
    qs: Array

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return STEP_COUNT * self.step


class Demand(NamedTuple):
    """`R` quantities that must not become negative, linearized about a course.

    Attributes:
        slack: Value of each quantity on the course `(R,)` [m].
        rows: Numbers of the `K` positions on which each quantity depends `(R, K)`.
        slopes: Derivatives by these positions `(R, K, n)` [m/rad].
        growth: Derivative by the length of a step at constant positions `(R,)` [m/s].
    """

    slack: Array
    rows: NDArray[np.intp]
    slopes: Array
    growth: Array


class Transcription:
    """The quadratic programs of the motions between two states.

    The variables are the inner values `y` of all joints, the length `h` of a step, and the violated distance,
    each as a share of its limit, last value or unit.

    Args:
        start, end: The states.
        limits: Joint limits.
    """

    def __init__(self, start: JointState, end: JointState, limits: JointLimits) -> None:
        self._start, self._end = start, end
        self._grid = grid = _build_grid(limits.joint_count)
        self._inner_count = limits.joint_count * (STEP_COUNT - 1)
        velocity, self._acceleration, jerk = (
            share * limit
            for share, limit in zip(
                USED_LIMIT_SHARES, (limits.velocity, limits.acceleration, limits.jerk), strict=True
            )
        )
        half_steps, accelerations, jerks = len(grid.half), len(grid.accelerations), len(grid.jerks)
        jerk_ends = np.zeros((limits.joint_count, STEP_COUNT))
        jerk_ends[:, 0] -= start.qdd
        jerk_ends[:, -1] += end.qdd
        velocity_ends = np.outer(start.qdd, grid.half[:, 0]) + np.outer(end.qdd, grid.half[:, -1])
        # Each row limits the absolute value of `row y + linear h + quadratic h²` to
        # `bound[0] h + bound[1] h² + bound[2] h³`.
        self._linear = np.concatenate(
            [np.zeros(accelerations), np.repeat(start.qd, half_steps), np.zeros(jerks)]
        )
        self._quadratic = np.concatenate([np.zeros(accelerations), velocity_ends.ravel(), jerk_ends.ravel()])
        self._bound = np.zeros((3, len(self._linear)))
        self._bound[1, :accelerations] = np.repeat(self._acceleration, STEP_COUNT - 1)
        self._bound[0, accelerations:-jerks] = np.repeat(velocity, half_steps)
        self._bound[2, -jerks:] = np.repeat(jerk, STEP_COUNT)

    def states(self, course: JointCourse) -> list[JointState]:
        """Return the states at all half steps, including the start and the end."""
        h, grid, start = course.step, self._grid, self._start
        y = course.accelerations * h**2
        qd = start.qd + (grid.half @ y.T) / h
        qdd = np.empty((2 * STEP_COUNT - 1, len(y)))
        qdd[::2], qdd[1::2] = ((y[:, :-1] + y[:, 1:]) / 2).T / h**2, course.accelerations[:, 1:-1].T
        at_half_steps = slice(SAMPLES_PER_STEP // 2 - 1, None, SAMPLES_PER_STEP // 2)
        return [start, *map(JointState, course.qs[at_half_steps], qd, qdd), self._end]

    def fit(self, step: float, first: Array) -> JointCourse | None:
        """Return the course with steps of `step` [s] that is nearest to positions `(M, n)` [rad], or None."""
        program, inner_count = self._build_program(step), self._inner_count
        inner = self._grid.place[:, 1:-1]
        residual = first - self._start.q - self._end_terms(step)
        scale = program.scale[:inner_count]
        program.hessian[:inner_count, :inner_count] += (
            scale[:, None] * np.kron(np.eye(len(self._acceleration)), inner.T @ inner) * scale
        )
        program.gradient[:inner_count] = -(inner.T @ residual).T.ravel() * scale
        program.low[inner_count] = program.high[inner_count] = 1.0
        return self._solve(step, program)

    def shorten(self, last: JointCourse, demands: Sequence[Demand], trust: float) -> JointCourse | None:
        """Return the shortest course near the last one that meets the demands, or None if there is none.

        `trust` is the largest change of an acceleration as a share of its limit.
        """
        step, start, inner_count = last.step, self._start, self._inner_count
        program = self._build_program(step)
        program.gradient[inner_count:] = STEP_COUNT * step, VIOLATION_COST * _DISTANCE_UNIT
        before = (last.accelerations[:, 1:-1] / self._acceleration[:, None]).ravel()
        program.low[:inner_count], program.high[:inner_count] = before - trust, before + trust
        ends = np.stack([start.qdd, self._end.qdd])
        rows, upper = [], []
        for demand in demands:
            place, slopes = self._grid.place[demand.rows], demand.slopes
            quadratic = np.einsum("rke,rkj,ej->r", place[:, :, [0, -1]], slopes, ends)
            linear = np.einsum("rkj,j,rk->r", slopes, start.qd, self._grid.times[demand.rows])
            part = np.empty((len(slopes), inner_count + 2))
            inner = np.einsum("rkj,rki->rji", slopes, place[:, :, 1:-1])
            part[:, :inner_count] = -inner.reshape(-1, inner_count)
            part[:, inner_count] = -linear - 2 * step * quadratic - demand.growth
            part[:, inner_count + 1] = -1.0
            rows.append(part)
            offset = np.einsum("rkj,rkj->r", slopes, start.q - last.qs[demand.rows])
            upper.append(demand.slack - EXTRA_DISTANCE + offset - step**2 * quadratic - step * demand.growth)
        return self._solve(step, program, np.concatenate(rows), np.concatenate(upper))

    def _build_program(self, step: float) -> _Program:
        """Return the program without demands, linearized about steps of `step` [s]."""
        grid, start, end, h_column = self._grid, self._start, self._end, self._inner_count
        # The powers h, h², h³ are replaced by their tangents `slope h + offset`.
        slopes, offsets = np.array([1.0, 2 * step, 3 * step**2]), np.array([0.0, -(step**2), -2 * step**3])
        bound_slope, bound_offset = slopes @ self._bound, offsets @ self._bound
        slope, offset = self._linear + 2 * step * self._quadratic, step**2 * self._quadratic
        rows, limits, joints = grid.rows.copy(), len(bound_slope), len(start.q)
        rows[:limits, h_column], rows[limits : 2 * limits, h_column] = (
            slope - bound_slope,
            -slope - bound_slope,
        )
        end_accelerations = np.stack([start.qdd, end.qdd])
        velocity_change = (grid.velocity[-1, [0, -1]][:, None] * end_accelerations).sum(axis=0)
        position_change = (grid.position[-1, [0, -1]][:, None] * end_accelerations).sum(axis=0)
        rows[2 * limits : -joints, h_column] = start.qd - end.qd + 2 * step * velocity_change
        rows[-joints:, h_column] = STEP_COUNT * start.qd + 2 * step * position_change
        row_low = np.full(len(rows), -_UNBOUNDED)
        row_high = np.concatenate(
            [
                bound_offset + offset, bound_offset - offset, step**2 * velocity_change,
                end.q - start.q + step**2 * position_change,
            ]
        )  # fmt: skip
        row_low[2 * limits :] = row_high[2 * limits :]
        low, high = np.full(h_column + 2, -_UNBOUNDED), np.full(h_column + 2, _UNBOUNDED)
        low[h_column:], high[h_column] = (MIN_STEP_CHANGE, 0.0), MAX_STEP_CHANGE
        scale = np.concatenate(
            [np.repeat(self._acceleration * step**2, STEP_COUNT - 1), [step, _DISTANCE_UNIT]]
        )
        hessian, gradient = SMOOTHNESS_WEIGHT * np.eye(h_column + 2), np.zeros(h_column + 2)
        return _Program(scale, hessian, gradient, rows, low, high, row_low, row_high, 2 * joints)

    def _end_terms(self, step: float) -> Array:
        """Return the terms of all positions `(M, n)` [rad] due to the states at start and end."""
        grid, start, end = self._grid, self._start, self._end
        quadratic = np.outer(grid.place[:, 0], start.qdd) + np.outer(grid.place[:, -1], end.qdd)
        return np.outer(grid.times, start.qd * step) + step**2 * quadratic

    def _solve(
        self, step: float, program: _Program, rows: Array | None = None, upper: Array | None = None
    ) -> JointCourse | None:
        """Return the solution of a program with additional `rows`, at most `upper`, or None."""
        solution = program.solve(rows, upper)
        if solution is None:
            return None
        h = step * float(solution[self._inner_count])
        inner = (solution * program.scale)[: self._inner_count].reshape(-1, STEP_COUNT - 1)
        y = np.column_stack([self._start.qdd * h**2, inner, self._end.qdd * h**2])
        qs = self._start.q + np.outer(self._grid.times, self._start.qd * h) + self._grid.place @ y.T
        return JointCourse(h, y / h**2, qs)


class _Program(NamedTuple):
    """A quadratic program: minimize `x hessian x / 2 + gradient x` within bounds.

    The bounds are `low <= x <= high` and `row_low <= rows (scale x) <= row_high`.

    Attributes:
        scale: Units of the variables `x`.
        equation_count: Number of equations, which are the last rows.
    """

    scale: Array
    hessian: Array
    gradient: Array
    rows: Array
    low: Array
    high: Array
    row_low: Array
    row_high: Array
    equation_count: int

    def solve(self, more_rows: Array | None, upper: Array | None) -> Array | None:
        """Return the solution with additional rows that are at most `upper`, or None if there is none."""
        rows, row_low, row_high = self.rows, self.row_low, self.row_high
        if more_rows is not None and upper is not None:
            rows = np.concatenate([more_rows, rows])
            row_low = np.concatenate([np.full(len(upper), -_UNBOUNDED), row_low])
            row_high = np.concatenate([upper, row_high])
        kinds = np.zeros(len(self.low) + len(rows), dtype=np.int32)
        kinds[-self.equation_count :] = _EQUALITY
        solution, _, status, _ = daqp.solve(
            self.hessian, self.gradient, np.ascontiguousarray(rows * self.scale),
            np.concatenate([self.high, row_high]), np.concatenate([self.low, row_low]), kinds,
        )  # fmt: skip
        return np.asarray(solution) if status == _SOLVED else None


class _Grid(NamedTuple):
    """Linear maps from the `STEP_COUNT + 1` values `y` of a joint to its states, and the rows of the limits.

    Attributes:
        velocity, position: Maps to the states at the ends of the steps `(STEP_COUNT + 1, STEP_COUNT + 1)`.
        half: Map to the velocities at the inner half steps `(2 STEP_COUNT - 1, STEP_COUNT + 1)`.
        place: Map to the positions at `SAMPLE_SHARES` `(M, STEP_COUNT + 1)`.
        times: Times of these positions [steps] `(M,)`.
        accelerations, jerks: Maps from the inner values of all joints to accelerations and jerks.
        rows: Rows of all limits, of the negated limits, and of the final state; the last two columns, for
            step and violated distance, are 0.
    """

    velocity: Array
    position: Array
    half: Array
    place: Array
    times: Array
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
    times = np.asarray(STEP_COUNT * SAMPLE_SHARES)
    step = times.astype(int)
    share = times - step
    place = position[step] + share[:, None] * velocity[step]
    sample = np.arange(len(times))
    place[sample, step] += share**2 / 2 - share**3 / 6
    place[sample, step + 1] += share**3 / 6
    half = np.empty((2 * STEP_COUNT - 1, STEP_COUNT + 1))
    half[1::2] = velocity[1:-1]
    half[::2] = velocity[:-1]
    for k in range(STEP_COUNT):
        half[2 * k, k : k + 2] += 3 / 8, 1 / 8
    joints = np.eye(joint_count)
    accelerations = np.asarray(np.kron(joints, np.eye(STEP_COUNT - 1)), dtype=np.float64)
    jerks = np.asarray(np.kron(joints, np.diff(np.eye(STEP_COUNT + 1), axis=0)[:, 1:-1]), dtype=np.float64)
    limits = np.concatenate([accelerations, np.kron(joints, half[:, 1:-1]), jerks])
    ends = [np.kron(joints, velocity[-1, 1:-1]), np.kron(joints, position[-1, 1:-1])]
    rows = np.pad(np.concatenate([limits, -limits, *ends]), ((0, 0), (0, 2)))
    return _Grid(velocity, position, half, place, times, accelerations, jerks, rows)
