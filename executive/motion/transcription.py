"""Direct transcription of a motion as a quadratic program: each of `N` equal time steps has a constant jerk.

The steps take `h` seconds. The accelerations `a_0 ... a_N` at the ends of the steps change linearly within
the steps. With the scaled accelerations `y = a h²`, integration gives position `q`, velocity `v` and jerk `j`
of step `k`:

    v_k+1 h = v_k h + (y_k + y_k+1) / 2
    q_k+1 = q_k + v_k h + y_k / 3 + y_k+1 / 6
    j_k h³ = y_k+1 - y_k

These equations are linear in `y` and `h`. The given accelerations at start and end add terms `a_0 h²` and
`a_N h²`, which are linearized. The maximum acceleration `A` and the maximum jerk `J` limit `y` to `A h²` and
its differences to `J h³`. Both limits are convex in `h`; their tangents replace them as lower bounds, so that
no solution exceeds a limit. Distances from obstacles are linearized in the joint positions. Each program
finds the fastest motion inside a trust region around the previous iterate.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple, TypeAlias

import daqp
import numpy as np
from numpy.typing import NDArray

from executive.cell.arm import JointState
from executive.geometry import Array
from executive.motion.joints import JointLimits

STEP_COUNT = 8
"""Number of time steps of a motion."""
SAMPLES_PER_STEP = 12
"""Number of joint positions per time step at which distances are evaluated."""
SAMPLE_FRACTIONS = np.arange(1, STEP_COUNT * SAMPLES_PER_STEP) / (STEP_COUNT * SAMPLES_PER_STEP)
"""Times of the samples as fractions of the duration `(M,)`, without start and end."""
USED_LIMIT_FRACTIONS = (0.98, 0.995, 0.995)
"""Used fractions of the velocity, acceleration and jerk limits.

Velocities are limited at the half steps; between half steps, a velocity may rise by up to `j (h / 2)² / 8`.
"""
VIOLATION_COST = 20.0
"""Cost of a violated constraint, as a duration per distance [s/m]."""
EXTRA_DISTANCE = 1e-3
"""Addition to the required distances in quadratic programs, because linearized distances have errors [m]."""
SMOOTHNESS_WEIGHT = 1e-4
"""Weight of the squared accelerations (as fractions of their limits), which makes the solution unique [s]."""
MIN_DURATION_FACTOR = 0.8
"""Minimum factor on the duration of the motion in one quadratic program."""
MAX_DURATION_FACTOR = 1.6
"""Maximum factor on the duration of the motion in one quadratic program."""
Rows: TypeAlias = tuple[Array, Array]
"""`R` linear constraints of a program: coefficients of `V` variables `(R, V)`, and upper bounds `(R,)`."""
_VIOLATION_UNIT = 0.01  # [m]
_UNBOUNDED = 1e30  # bound that daqp treats as infinite
_STATUS_SOLVED = 1  # of daqp
_EQUALITY_CONSTRAINT = 5  # of daqp


class DiscreteMotion(NamedTuple):
    """A motion in `STEP_COUNT` time steps.

    Attributes:
        step_duration: Duration of a time step [s].
        accelerations: Accelerations at the ends of the time steps `(n, STEP_COUNT + 1)` [rad/s²].
        qs: Joint positions at `SAMPLE_FRACTIONS` `(M, n)` [rad].
    """

    step_duration: float
    accelerations: Array
    qs: Array

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return STEP_COUNT * self.step_duration


class LinearizedConstraints(NamedTuple):
    """`R` inequality constraints `slack >= 0`, linearized about a motion.

    Attributes:
        slack: Slack of each constraint in the motion `(R,)` [m].
        samples: Indices of the `K` samples on which each constraint depends `(R, K)`.
        gradients: Derivatives of the slack with respect to the positions at the samples `(R, K, n)` [m/rad].
        step_derivatives: Derivatives of the slack with respect to the duration of a time step `(R,)` [m/s].
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
        self._start = start
        self._end = end
        self._matrices = matrices = _build_matrices(limits.joint_count)
        velocity_fraction, acceleration_fraction, jerk_fraction = USED_LIMIT_FRACTIONS
        self._max_acceleration = acceleration_fraction * limits.acceleration
        self._max_inner_accelerations = np.repeat(self._max_acceleration, STEP_COUNT - 1)
        self._inner_count = len(self._max_inner_accelerations)
        self._boundary_qdd = np.array([start.qdd, end.qdd])
        # Each constraint limits `row y + linear h + quadratic h²` to `bound @ (1, h, h², h³)`. The first rows
        # limit accelerations, velocities and jerks, the next rows limit their negatives, and the last rows
        # fix the final state.
        half_step_map = matrices.half_step_map
        velocity_count = len(half_step_map)
        jerk_count = limits.joint_count * STEP_COUNT
        jerk_ends = np.zeros((limits.joint_count, STEP_COUNT))
        jerk_ends[:, 0] = -start.qdd
        jerk_ends[:, -1] = end.qdd
        velocity_ends = np.outer(start.qdd, half_step_map[:, 0]) + np.outer(end.qdd, half_step_map[:, -1])
        linear = np.pad(np.repeat(start.qd, velocity_count), (self._inner_count, jerk_count))
        quadratic = np.pad(np.append(velocity_ends, jerk_ends), (self._inner_count, 0))
        bound = np.zeros((4, len(linear)))
        bound[2, : self._inner_count] = self._max_inner_accelerations
        max_velocity = velocity_fraction * limits.velocity
        bound[1, self._inner_count : -jerk_count] = np.repeat(max_velocity, velocity_count)
        bound[3, -jerk_count:] = np.repeat(jerk_fraction * limits.jerk, STEP_COUNT)
        final_bound = np.zeros((4, 2 * limits.joint_count))
        final_bound[0, limits.joint_count :] = end.q - start.q
        last_rows = (matrices.velocity_map[-1], matrices.position_map[-1])
        final_quadratic = [(row[[0, -1], None] * self._boundary_qdd).sum(axis=0) for row in last_rows]
        self._linear_terms = np.concatenate([linear, -linear, start.qd - end.qd, STEP_COUNT * start.qd])
        self._quadratic_terms = np.concatenate([quadratic, -quadratic, *final_quadratic])
        self._bound = np.hstack([bound, bound, final_bound])

    def compute_states(self, motion: DiscreteMotion) -> list[JointState]:
        """Return the states of a motion at all half steps, including the start and the end."""
        h = motion.step_duration
        y = motion.accelerations * h**2
        qd = self._start.qd + (self._matrices.half_step_map @ y.T) / h
        qdd = np.empty((2 * STEP_COUNT - 1, len(y)))
        qdd[::2] = ((y[:, :-1] + y[:, 1:]) / 2).T / h**2  # middle of the steps
        qdd[1::2] = motion.accelerations[:, 1:-1].T
        half_steps = slice(SAMPLES_PER_STEP // 2 - 1, None, SAMPLES_PER_STEP // 2)
        return [self._start, *map(JointState, motion.qs[half_steps], qd, qdd), self._end]

    def fit(self, step: float, qs: Array) -> DiscreteMotion | None:
        """Return the motion with time steps of `step` [s] that is nearest to `qs` `(M, n)` [rad], or None."""
        start = self._start
        inner_count = self._inner_count
        sample_map = self._matrices.sample_map
        position_map = sample_map[:, 1:-1]
        quadratic = np.outer(sample_map[:, 0], start.qdd) + np.outer(sample_map[:, -1], self._end.qdd)
        boundary_terms = np.outer(self._matrices.sample_times, start.qd * step) + step**2 * quadratic
        residual = qs - start.q - boundary_terms
        hessian = self._matrices.hessian.copy()
        scale = self._max_inner_accelerations * step**2
        squares = np.kron(np.eye(len(self._max_acceleration)), position_map.T @ position_map)
        hessian[:inner_count, :inner_count] += scale[:, None] * squares * scale
        gradient = np.append(-(position_map.T @ residual).T.ravel() * scale, [0.0, 0.0])
        bounds = np.tile([[-_UNBOUNDED], [_UNBOUNDED]], inner_count + 2)
        bounds[:, inner_count] = 1.0
        bounds[0, -1] = 0.0
        return self._solve(step, hessian, gradient, bounds, [])

    def solve_subproblem(
        self, iterate: DiscreteMotion, constraints: Sequence[LinearizedConstraints], trust_radius: float
    ) -> DiscreteMotion | None:
        """Return the motion near the iterate with the smallest cost, or None if the program has no solution.

        The cost is the duration plus the cost of the largest violation of a constraint.

        Args:
            iterate: Motion about which the constraints are linearized.
            constraints: Groups of constraints.
            trust_radius: Maximum change of an acceleration as a fraction of its limit.
        """
        step = iterate.step_duration
        start = self._start
        inner_count = self._inner_count
        gradient = np.append(np.zeros(inner_count), [STEP_COUNT * step, VIOLATION_COST * _VIOLATION_UNIT])
        last_values = (iterate.accelerations[:, 1:-1] / self._max_acceleration[:, None]).ravel()
        bounds = np.empty((2, inner_count + 2))
        bounds[:, :inner_count] = last_values - trust_radius, last_values + trust_radius
        bounds[:, inner_count:] = (MIN_DURATION_FACTOR, 0.0), (MAX_DURATION_FACTOR, _UNBOUNDED)
        extra_constraints = []
        # Axes of the arrays: r constraint, k sample, j joint, i inner value, e start or end.
        for group in constraints:
            position_map = self._matrices.sample_map[group.samples]
            gradients = group.gradients
            quadratic = np.einsum("rke,rkj,ej->r", position_map[:, :, [0, -1]], gradients, self._boundary_qdd)
            linear = np.einsum("rkj,j,rk->r", gradients, start.qd, self._matrices.sample_times[group.samples])
            rows = np.empty((len(gradients), inner_count + 2))
            value_gradients = np.einsum("rkj,rki->rji", gradients, position_map[:, :, 1:-1])
            rows[:, :inner_count] = -value_gradients.reshape(-1, inner_count)
            rows[:, inner_count] = -linear - 2 * step * quadratic - group.step_derivatives
            rows[:, inner_count + 1] = -1.0
            offset = np.einsum("rkj,rkj->r", gradients, start.q - iterate.qs[group.samples])
            slack = group.slack - EXTRA_DISTANCE + offset
            extra_constraints.append((rows, slack - step**2 * quadratic - step * group.step_derivatives))
        return self._solve(step, self._matrices.hessian, gradient, bounds, extra_constraints)

    def _solve(
        self, step: float, hessian: Array, gradient: Array, bounds: Array, extra_constraints: Sequence[Rows]
    ) -> DiscreteMotion | None:
        """Return the motion that solves a program linearized about time steps of `step` [s], or None.

        The program minimizes `x hessian x / 2 + gradient x` for `V` variables `x` in their units.

        Args:
            step: Duration of a time step in the last motion [s].
            hessian: Quadratic cost `(V, V)`.
            gradient: Linear cost `(V,)`.
            bounds: Smallest and largest values of the variables `(2, V)`.
            extra_constraints: Groups of `R` constraints besides the limits and the final state: coefficients
                `(R, V)` of the variables in SI units, and upper bounds `(R,)`.
        """
        rows = np.concatenate([*(rows for rows, _ in extra_constraints), self._matrices.constraint_matrix])
        # The powers h, h², h³ are replaced by their tangents `slope h + offset`.
        slopes = np.array([0.0, 1.0, 2 * step, 3 * step**2])
        offsets = np.array([1.0, 0.0, -(step**2), -2 * step**3])
        step_column = self._linear_terms + 2 * step * self._quadratic_terms - slopes @ self._bound
        rows[-len(step_column) :, self._inner_count] = step_column
        scale = np.concatenate([self._max_inner_accelerations * step**2, [step, _VIOLATION_UNIT]])
        rows *= scale
        row_upper = step**2 * self._quadratic_terms + offsets @ self._bound
        upper = np.concatenate([bounds[1], *(extra_upper for _, extra_upper in extra_constraints), row_upper])
        lower = np.full(len(upper), -_UNBOUNDED)
        lower[: len(scale)] = bounds[0]
        equality_rows = slice(-2 * len(self._max_acceleration), None)
        lower[equality_rows] = upper[equality_rows]
        constraint_types = np.zeros(len(upper), dtype=np.int32)
        constraint_types[equality_rows] = _EQUALITY_CONSTRAINT
        solution, _, status, _ = daqp.solve(hessian, gradient, rows, upper, lower, constraint_types)
        if status != _STATUS_SOLVED:
            return None
        h = step * float(solution[self._inner_count])
        inner_values = (solution * scale)[: self._inner_count].reshape(-1, STEP_COUNT - 1)
        end_values = (self._boundary_qdd * h**2)[:, :, None]
        y = np.concatenate([end_values[0], inner_values, end_values[1]], axis=1)
        matrices = self._matrices
        qs = self._start.q + np.outer(matrices.sample_times, self._start.qd * h) + matrices.sample_map @ y.T
        return DiscreteMotion(h, y / h**2, qs)


class _DiscretizationMatrices(NamedTuple):
    """Linear maps from the `STEP_COUNT + 1` values `y` of a joint to its states, and program matrices.

    Attributes:
        velocity_map: Map to the velocities at the ends of the steps `(STEP_COUNT + 1, STEP_COUNT + 1)`.
        position_map: Map to the positions at the ends of the steps `(STEP_COUNT + 1, STEP_COUNT + 1)`.
        half_step_map: Map to the velocities at the inner half steps `(2 STEP_COUNT - 1, STEP_COUNT + 1)`.
        sample_map: Map to the positions at `SAMPLE_FRACTIONS` `(M, STEP_COUNT + 1)`.
        sample_times: Times of the samples [steps] `(M,)`.
        constraint_matrix: Rows for all limits, for the negated limits, and for the final state; the last two
            columns, for step and violation, are 0.
        hessian: Quadratic cost of the `V` variables in their units `(V, V)`, which makes the solution unique.
    """

    velocity_map: Array
    position_map: Array
    half_step_map: Array
    sample_map: Array
    sample_times: Array
    constraint_matrix: Array
    hessian: Array


@lru_cache(maxsize=4)
def _build_matrices(joint_count: int) -> _DiscretizationMatrices:
    """Return the matrices for time steps of duration 1, by the integration in the module docstring.

    Over a part `f` of a step, `v f`, `y_k (f² / 2 - f³ / 6)` and `y_k+1 f³ / 6` add up to the position, and
    `y_k (f - f² / 2)` and `y_k+1 f² / 2` to the velocity.
    """
    velocity, position = np.zeros((2, STEP_COUNT + 1, STEP_COUNT + 1))
    for k in range(STEP_COUNT):
        velocity[k + 1] = velocity[k]
        position[k + 1] = position[k] + velocity[k]
        velocity[k + 1, k : k + 2] += 1 / 2
        position[k + 1, k : k + 2] += 1 / 3, 1 / 6
    sample_times = np.asarray(STEP_COUNT * SAMPLE_FRACTIONS)
    step = sample_times.astype(int)
    f = sample_times - step
    sample_map = position[step] + f[:, None] * velocity[step]
    sample = np.arange(len(sample_times))
    sample_map[sample, step] += f**2 / 2 - f**3 / 6
    sample_map[sample, step + 1] += f**3 / 6
    half_step_map = np.empty((2 * STEP_COUNT - 1, STEP_COUNT + 1))
    half_step_map[1::2] = velocity[1:-1]
    half_step_map[::2] = velocity[:-1]
    for k in range(STEP_COUNT):
        half_step_map[2 * k, k : k + 2] += 3 / 8, 1 / 8
    joints = np.eye(joint_count)
    accelerations = np.eye(STEP_COUNT + 1)[1:-1]
    jerks = np.diff(np.eye(STEP_COUNT + 1), axis=0)
    limits = [np.kron(joints, rows[:, 1:-1]) for rows in (accelerations, half_step_map, jerks)]
    final_state = [np.kron(joints, row[-1, 1:-1]) for row in (velocity, position)]
    rows = np.concatenate([*limits, *(-limit for limit in limits), *final_state])
    rows = np.pad(rows, ((0, 0), (0, 2)))
    hessian = SMOOTHNESS_WEIGHT * np.eye(rows.shape[1])
    return _DiscretizationMatrices(velocity, position, half_step_map, sample_map, sample_times, rows, hessian)
