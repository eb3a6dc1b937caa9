"""A motion as a quadratic program: jerks that are constant over equal steps of time.

Direct transcription. With `N` steps of `h` seconds and accelerations `a_0 ... a_N` that change linearly in
between, positions, velocities and jerks are linear in `y = a h²` (and `h` times the velocity at the start):

    v_k h = v_0 h + sum of (y_i + y_i+1) / 2,   q_k = q_0 + k v_0 h + sums of the same,   j_k h³ = y_k+1 - y_k

so dynamics and end state are met exactly. What depends on the duration in another way, the limits `A h²` and
`J h³`, is convex in `h`, and replaced by its tangent, which lies below: steps are never outside the limits.
Distances from things are linearized in the joints. The solution is the shortest motion near the last one.
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
"""Steps of time of a motion."""
SAMPLES_PER_STEP = 16
"""Places per step at which distances are looked at."""
SAMPLE_SHARES = np.arange(1, STEP_COUNT * SAMPLES_PER_STEP) / (STEP_COUNT * SAMPLES_PER_STEP)
"""Shares of a motion's duration at which those are `(M,)`."""
USED_LIMIT_SHARES = 0.98, 0.995, 0.995
"""Share of the velocity, acceleration, jerk limits that is used.

Velocities are looked at every half step `h / 2`; between those one may be higher by `j (h / 2)² / 8`.
"""
VIOLATION_COST = 20.0
"""Seconds that a metre too near to something counts for."""
EXTRA_DISTANCE = 1e-3
"""Distance more than needed that is aimed at, since the linear distance is not the true one [m]."""
SMOOTHNESS_WEIGHT = 1e-4
"""Weight of the squares of accelerations as shares of their limits: it settles what time leaves open [s]."""
MIN_STEP_CHANGE, MAX_STEP_CHANGE = 0.8, 1.6
"""Change of the duration in one solution, at most."""
_METRE = 0.01  # [m] what distances are shares of
_UNBOUNDED = 1e30
_SOLVED, _EQUALITY = 1, 5  # what daqp calls them


class JointCourse(NamedTuple):
    """A motion in steps.

    Attributes:
        step: Length of one [s].
        accelerations: At the ends of the steps `(n, STEPS + 1)` [rad/s²].
        qs: Joint positions at the places looked at `(M, n)` [rad], neither its start nor its end among them.
    """

    step: float
    accelerations: Array
    qs: Array

    @property
    def duration(self) -> float:
        """Time it takes [s]."""
        return STEP_COUNT * self.step


class Demand(NamedTuple):
    """Numbers that must not become negative, and how they depend on positions of a course: `R` numbers.

    Attributes:
        slack: What they are now `(R,)` [m].
        rows: Positions that each depends on `(R, K)`.
        slopes: How it depends on them `(R, K, n)` [m/rad].
        growth: How it depends on the length of a step, all positions being the same `(R,)` [m/s].
    """

    slack: Array
    rows: NDArray[np.intp]
    slopes: Array
    growth: Array


class Transcription:
    """The quadratic programs of motions from one state to another.

    Their variables are the inner values `y` of all joints, the length of a step, and the distance by which
    something may be too near, each as a share of what it may be or was last.

    Args:
        start, end: The states.
        limits: What the joints may do.
    """

    def __init__(self, start: JointState, end: JointState, limits: JointLimits) -> None:
        self._start, self._end = start, end
        self._grid = _grid(limits.joint_count)
        self._inner = limits.joint_count * (STEP_COUNT - 1)
        velocity, acceleration, jerk = (
            share * limit
            for share, limit in zip(
                USED_LIMIT_SHARES, (limits.velocity, limits.acceleration, limits.jerk), strict=True
            )
        )
        self._acceleration = acceleration
        grid, halves = self._grid, len(self._grid.half)
        ends = np.zeros((limits.joint_count, STEP_COUNT))
        ends[:, 0] -= start.qdd
        ends[:, -1] += end.qdd
        given = np.outer(start.qdd, grid.half[:, 0]) + np.outer(end.qdd, grid.half[:, -1])
        # A row bounds `sum of rows times y + steady h + bent h²` by `reach[0] h + reach[1] h² + reach[2] h³`.
        still, moving = np.zeros(len(grid.accelerations)), np.repeat(start.qd, halves)
        self._steady = np.concatenate([still, moving, np.zeros(len(grid.jerks))])
        self._bent = np.concatenate([still, given.ravel(), ends.ravel()])
        self._reach = np.zeros((3, len(self._bent)))
        self._reach[1, : len(still)] = np.repeat(acceleration, STEP_COUNT - 1)
        self._reach[0, len(still) : -len(grid.jerks)] = np.repeat(velocity, halves)
        self._reach[2, -len(grid.jerks) :] = np.repeat(jerk, STEP_COUNT)

    def states(self, course: JointCourse) -> list[JointState]:
        """Return the states at every half step, the start and the end among them."""
        h, grid, start = course.step, self._grid, self._start
        y = course.accelerations * h**2
        qd = start.qd + (grid.half @ y.T) / h
        middle = (y[:, :-1] + y[:, 1:]) / 2
        qdd = np.empty((2 * STEP_COUNT - 1, len(y)))
        qdd[::2], qdd[1::2] = middle.T / h**2, course.accelerations[:, 1:-1].T
        inner = slice(SAMPLES_PER_STEP // 2 - 1, None, SAMPLES_PER_STEP // 2)
        return [start, *map(JointState, course.qs[inner], qd, qdd), self._end]

    def fit(self, step: float, first: Array) -> JointCourse | None:
        """Return the course with steps of `step` [s] that is nearest to positions `(M, n)` [rad], or None."""
        program = self._program(step)
        inner = self._grid.place[:, 1:-1]
        off = first - self._start.q - self._given(step)
        scale = program.scale[: self._inner]
        program.square[: self._inner, : self._inner] += (
            scale[:, None] * np.kron(np.eye(len(self._acceleration)), inner.T @ inner) * scale
        )
        program.cost[: self._inner] = -(inner.T @ off).T.ravel() * scale
        program.low[self._inner] = program.high[self._inner] = 1.0
        return self._course(step, program)

    def shorten(self, last: JointCourse, demands: Sequence[Demand], trust: float) -> JointCourse | None:
        """Return the shortest course near the last one that meets demands, or None where there is none.

        `trust` is the share of the limits by which its accelerations differ from the last one's at most.
        """
        step, start = last.step, self._start
        program = self._program(step)
        program.cost[self._inner :] = STEP_COUNT * step, VIOLATION_COST * _METRE
        before = (last.accelerations[:, 1:-1] / self._acceleration[:, None]).ravel()
        program.low[: self._inner], program.high[: self._inner] = before - trust, before + trust
        rows, most = [], []
        for demand in demands:
            place, slopes = self._grid.place[demand.rows], demand.slopes
            ends = np.stack([start.qdd, self._end.qdd])
            bent = np.einsum("rke,rkj,ej->r", place[:, :, [0, -1]], slopes, ends)
            part = np.empty((len(slopes), self._inner + 2))
            part[:, : self._inner] = -np.einsum("rkj,rki->rji", slopes, place[:, :, 1:-1]).reshape(
                -1, self._inner
            )
            steady = np.einsum("rkj,j,rk->r", slopes, start.qd, self._grid.times[demand.rows])
            part[:, self._inner] = -steady - 2 * step * bent - demand.growth
            part[:, self._inner + 1] = -1.0
            off = np.einsum("rkj,rkj->r", slopes, start.q - last.qs[demand.rows])
            rows.append(part)
            most.append(demand.slack - EXTRA_DISTANCE + off - step**2 * bent - step * demand.growth)
        return self._course(step, program, np.concatenate(rows), np.concatenate(most))

    def _program(self, step: float) -> _Program:
        """Return the program of all courses near one with steps of `step` [s], whatever they come near to."""
        grid, start, end = self._grid, self._start, self._end
        # Squares and cubes of the step are replaced by their tangents.
        rising, rest = np.array([1.0, 2 * step, 3 * step**2]), np.array([0.0, -(step**2), -2 * step**3])
        column, turning = rising @ self._reach, rest @ self._reach
        shift, turn = self._steady + 2 * step * self._bent, step**2 * self._bent
        rows, limits, joints, step_column = grid.rows.copy(), len(column), len(start.q), self._inner
        rows[:limits, step_column], rows[limits : 2 * limits, step_column] = shift - column, -shift - column
        speeds = np.outer(grid.velocity[-1, [0, -1]], np.ones(joints)) * (start.qdd, end.qdd)
        ways = np.outer(grid.position[-1, [0, -1]], np.ones(joints)) * (start.qdd, end.qdd)
        faster, farther = speeds.sum(axis=0), ways.sum(axis=0)
        rows[2 * limits : -joints, step_column] = start.qd - end.qd + 2 * step * faster
        rows[-joints:, step_column] = STEP_COUNT * start.qd + 2 * step * farther
        least = np.full(len(rows), -_UNBOUNDED)
        most = np.concatenate(
            [turning + turn, turning - turn, step**2 * faster, end.q - start.q + step**2 * farther]
        )
        least[2 * limits :] = most[2 * limits :]
        low, high = np.full(step_column + 2, -_UNBOUNDED), np.full(step_column + 2, _UNBOUNDED)
        low[step_column:], high[step_column] = (MIN_STEP_CHANGE, 0.0), MAX_STEP_CHANGE
        scale = np.concatenate([np.repeat(self._acceleration * step**2, STEP_COUNT - 1), [step, _METRE]])
        square, cost = SMOOTHNESS_WEIGHT * np.eye(step_column + 2), np.zeros(step_column + 2)
        return _Program(scale, square, cost, rows, low, high, least, most, 2 * joints)

    def _given(self, step: float) -> Array:
        """Return the part of all positions `(M, n)` [rad] that start and end decide."""
        grid, start, end = self._grid, self._start, self._end
        bent = np.outer(grid.place[:, 0], start.qdd) + np.outer(grid.place[:, -1], end.qdd)
        return np.outer(grid.times, start.qd * step) + step**2 * bent

    def _course(
        self, step: float, program: _Program, clear: Array | None = None, most: Array | None = None
    ) -> JointCourse | None:
        """Return the solution of a program, with rows `clear` that are at most `most` added, or None."""
        answer = program.solve(clear, most)
        if answer is None:
            return None
        h = step * float(answer[self._inner])
        inner = (answer * program.scale)[: self._inner].reshape(-1, STEP_COUNT - 1)
        y = np.column_stack([self._start.qdd * h**2, inner, self._end.qdd * h**2])
        qs = self._start.q + np.outer(self._grid.times, self._start.qd * h) + self._grid.place @ y.T
        return JointCourse(h, y / h**2, qs)


class _Program(NamedTuple):
    """A quadratic program: least `x square x / 2 + cost x`, `low <= x <= high`, `least <= rows x <= most`.

    Attributes:
        scale: What the variables `x` are shares of; `rows` are given for the values themselves.
        equalities: Number of the last rows that are equations.
    """

    scale: Array
    square: Array
    cost: Array
    rows: Array
    low: Array
    high: Array
    least: Array
    most: Array
    equalities: int

    def solve(self, clear: Array | None, most: Array | None) -> Array | None:
        """Return the solution, or None where there is none."""
        rows, least, upper = self.rows, self.least, self.most
        if clear is not None and most is not None:
            rows = np.concatenate([clear, rows])
            least = np.concatenate([np.full(len(most), -_UNBOUNDED), least])
            upper = np.concatenate([most, upper])
        kinds = np.zeros(len(self.low) + len(rows), dtype=np.int32)
        kinds[-self.equalities :] = _EQUALITY
        answer, _, flag, _ = daqp.solve(
            self.square, self.cost, np.ascontiguousarray(rows * self.scale),
            np.concatenate([self.high, upper]), np.concatenate([self.low, least]), kinds,
        )  # fmt: skip
        return np.asarray(answer) if flag == _SOLVED else None


class _Grid(NamedTuple):
    """How states follow from the `STEPS + 1` values `y`, and the rows of the limits for all joints.

    Attributes:
        velocity, position: At the ends of the steps `(STEPS + 1, STEPS + 1)`.
        half: Velocities at every half step between `(2 STEPS - 1, STEPS + 1)`.
        place: Positions at the places looked at `(M, STEPS + 1)`.
        times: When those are, in steps `(M,)`.
        accelerations, jerks: Rows over the inner values of all joints.
        rows: Rows of all limits, of both signs, and of the end state; their last two columns are for step
            and distance.
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
def _grid(joint_count: int) -> _Grid:
    velocity, position = np.zeros((2, STEP_COUNT + 1, STEP_COUNT + 1))
    for k in range(STEP_COUNT):
        velocity[k + 1], position[k + 1] = velocity[k], position[k] + velocity[k]
        velocity[k + 1, k : k + 2] += 1 / 2
        position[k + 1, k : k + 2] += 1 / 3, 1 / 6
    times = np.asarray(STEP_COUNT * SAMPLE_SHARES)
    before = times.astype(int)
    into = times - before
    place = position[before] + into[:, None] * velocity[before]
    number = np.arange(len(times))
    place[number, before] += into**2 / 2 - into**3 / 6
    place[number, before + 1] += into**3 / 6
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
    rows = np.concatenate([limits, -limits, *ends])
    return _Grid(
        velocity, position, half, place, times, accelerations, jerks,
        np.column_stack([rows, np.zeros((len(rows), 2))]),
    )  # fmt: skip
