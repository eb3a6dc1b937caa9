"""Trajectory optimization: the fastest motion between two states that avoids all obstacles.

The load limits the acceleration: the grip of the tool must hold with a safety factor.

Sequential quadratic programming: each step linearizes the distances of the iterate (the current motion) from
the obstacles, and finds the fastest motion near the iterate. The initial motion approximates a slow motion
without collision that stops at via points above the obstacles, and determines on which side the result passes
each obstacle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from executive.cell.arm import JointState
from executive.cell.device_config import STEP
from executive.cell.objects import ObjectClass
from executive.cell.tools import ToolModel
from executive.geometry import GRAVITY, Array
from executive.motion.clearance_model import ClearanceModel, NearestPairs
from executive.motion.configurations import Candidate
from executive.motion.joints import Kinematics
from executive.motion.trajectory import Connector, JointLimitError, PointToPoint, Trajectory
from executive.motion.transcription import (
    SAMPLES_PER_STEP,
    STEP_COUNT,
    VIOLATION_COST,
    DiscreteMotion,
    LinearizedConstraints,
    Transcription,
)

DISTANCE_PER_ACCELERATION = 0.02
"""Factor that converts accelerations to distances in the constraints of the optimizer [m per m/s²]."""
SAMPLE_STRIDE = 4
"""Every `SAMPLE_STRIDE`-th sample has a constraint; a divisor of `SAMPLES_PER_STEP`."""
_SECOND_DIFFERENCE = np.array([1.0, -2.0, 1.0])  # Product with three samples: acceleration * sample_time²
_FINITE_DIFFERENCE_STEP = 1e-4  # [rad]
MIN_ACCELERATION_FRACTION = 0.2
"""Minimum fraction of the planned accelerations after a slowdown, even if the tool holds with less force."""
MAX_SLACK = 0.03
"""Constraints with a larger slack are left out of a quadratic program [m]."""
INITIAL_TRUST_RADIUS = 0.3
"""Maximum change of the accelerations in the first optimization step, as a fraction of their limits."""
TRUST_RADIUS_FACTOR = 0.9
"""Factor on the maximum change of the accelerations after each optimization step."""
INITIAL_DURATION_FRACTIONS = (0.8, 1.0, 1.2)
"""Durations of the initial motion, as fractions of the duration of the motion that stops at via points.

The first one with a solution is used."""
JOINT_RANGE_MARGIN = 0.01
"""Minimum distance from the position limits of the joints [rad]."""
CONVERGENCE_TOLERANCE = 2e-3
"""Change of the cost in an optimization step below which the optimization has converged [s]."""


class PayloadLimit:
    """Acceleration limit of a load: the grip must withstand weight and inertia with the safety factor.

    The force on the grip is `m |a + g|`, with the mass `m` of the load, the acceleration `a` of its centre,
    and `g` = 9.81 m/s² upwards.

    Attributes:
        max_lift_acceleration: Maximum upward acceleration [m/s²].
    """

    def __init__(
        self, load: ObjectClass, holding_force: float, tool: ToolModel, kinematics: Kinematics
    ) -> None:
        # Maximum of |a + g| [m/s²].
        self._max_specific_force = holding_force / tool.safety_factor / load.mass
        self.max_lift_acceleration = max(self._max_specific_force - GRAVITY, tool.min_lift_acceleration)
        self._centre_offset = tool.get_hold_height(load) - load.height / 2
        self._kinematics = kinematics

    def find_acceleration_fraction(self, trajectory: Trajectory) -> float:
        """Return the largest factor, 0 to 1, on the accelerations with which the safety factor holds."""
        centres = self._locate_load(trajectory.samples.q)
        if len(centres) < 4:
            return 1.0
        # The interval before the last sample is shorter than a control step.
        accelerations = np.diff(centres[:-1], n=2, axis=0) / STEP**2
        # With the acceleration `a` and the maximum `f` of `|k a + g|`, the factor `k` of each interval solves
        # `k² (a a) + 2 k (a g) + g g - f² = 0`.
        a_a = np.sum(accelerations**2, axis=1) + 1e-12
        a_g = GRAVITY * accelerations[:, 2]
        discriminant = a_g**2 - a_a * (GRAVITY**2 - self._max_specific_force**2)
        fractions = (np.sqrt(np.maximum(discriminant, 0.0)) - a_g) / a_a
        return float(np.min(np.clip(np.where(discriminant < 0, 0.0, fractions), 0.0, 1.0)))

    def make_safe_motion(self, trajectory: Trajectory) -> Trajectory:
        """Return the motion, slowed down so that it keeps the safety factor if possible."""
        fraction = self.find_acceleration_fraction(trajectory)
        # Accelerations are proportional to the square of the speed.
        speed_factor = math.sqrt(max(fraction, MIN_ACCELERATION_FRACTION))
        return trajectory if fraction >= 1 else trajectory.make_slower_copy(speed_factor)

    def linearize(self, qs: Array, sample_time: float, max_slack: float) -> LinearizedConstraints:
        """Return the constraints that keep the load in the tool, linearized about a motion.

        Args:
            qs: Samples of the joint positions `(M, n)` [rad] of the motion, without start and end.
            sample_time: Time between two samples [s].
            max_slack: Constraints with a larger slack are omitted [m].
        """
        # The constrained samples include the ends of the time steps, where the acceleration has its extrema.
        # Each row of `samples` contains a constrained sample between its two neighbours.
        samples = np.arange(SAMPLE_STRIDE - 1, len(qs) - 1, SAMPLE_STRIDE)[:, None] + np.array([-1, 0, 1])
        centres = self._locate_load(qs)
        acceleration = _SECOND_DIFFERENCE @ centres[samples] / sample_time**2
        specific_force = acceleration + np.array([0.0, 0.0, GRAVITY])
        magnitude = np.linalg.norm(specific_force, axis=1)
        slack = DISTANCE_PER_ACCELERATION * (self._max_specific_force - magnitude)
        is_close = slack < max_slack
        slack = slack[is_close]
        samples = samples[is_close]
        acceleration = acceleration[is_close]
        force_direction = specific_force[is_close] / magnitude[is_close, None]
        displaced_qs = qs[samples][:, :, None] + _FINITE_DIFFERENCE_STEP * np.eye(qs.shape[1])
        displaced_centres = self._locate_load(displaced_qs.reshape(-1, qs.shape[1]))
        displaced_centres = displaced_centres.reshape(*displaced_qs.shape[:3], 3)
        jacobian = (displaced_centres - centres[samples][:, :, None]) / _FINITE_DIFFERENCE_STEP
        # Axes of the arrays: r constraint, k sample, j joint, x coordinate.
        force_gradients = np.einsum("k,rkjx,rx->rkj", _SECOND_DIFFERENCE, jacobian, force_direction)
        gradients = -DISTANCE_PER_ACCELERATION / sample_time**2 * force_gradients
        # If a motion takes more time, its accelerations fall with the square of the time.
        force_change = np.einsum("rx,rx->r", force_direction, acceleration)
        step_derivatives = 2 * DISTANCE_PER_ACCELERATION * force_change / (SAMPLES_PER_STEP * sample_time)
        return LinearizedConstraints(slack, samples, gradients, step_derivatives)

    def _locate_load(self, qs: Array) -> Array:
        """Return the centre of the load `(N, 3)` [m] at joint positions `(N, n)` [rad]."""
        tcps, axes = self._kinematics.compute_tcps_and_axes(qs)
        return np.asarray(tcps + self._centre_offset * axes)


@dataclass(frozen=True, eq=False)
class MotionProblem:
    """Start and constraints of all motions of a search.

    The slack of a state is the smallest of these margins: each clearance minus the required clearance [m],
    the maximum tilt of the tool minus its tilt as an equivalent distance [m], and the distance of each joint
    from its range limits [rad].

    Attributes:
        start: State at the start of the free part.
        connector: Planner of motions between two states within the joint limits.
        kinematics: Kinematics of the arm.
        clearance: Model of the distances from the obstacles.
        payload: Acceleration limit due to the load, or None.
    """

    start: JointState
    connector: Connector
    kinematics: Kinematics
    clearance: ClearanceModel
    payload: PayloadLimit | None = None

    def find_nearest_pairs(self, qs: Array, max_slack: float = MAX_SLACK) -> NearestPairs:
        """Return slack and nearest pairs at joint positions `(N, n)` [rad].

        A pair is a disc (a part of tool or load) and a prism (an obstacle).
        A slack up to `max_slack` is exact; a larger slack is an upper bound.
        """
        tcps, axes = self.kinematics.compute_tcps_and_axes(qs)
        pairs = self.clearance.find_nearest_pairs(tcps, axes, max_slack)
        range_slack = self._compute_range_slack(qs).min(axis=1)
        return pairs._replace(slack=np.minimum(pairs.slack, range_slack))

    def compute_gradients(self, qs: Array, pairs: NearestPairs) -> Array:
        """Return the gradients `(N, n)` [m/rad] of the slack at joint positions `(N, n)` [rad].

        `pairs` is the result of `find_nearest_pairs` at the joint positions.
        """
        joint_count = qs.shape[1]
        displaced_qs = (qs[:, None] + _FINITE_DIFFERENCE_STEP * np.eye(joint_count)).reshape(-1, joint_count)
        displaced = self.kinematics.compute_tcps_and_axes(displaced_qs)
        new_tcps, new_axes = (values.reshape(-1, joint_count, 3) for values in displaced)
        changes = self.clearance.compute_slack_changes(pairs, new_tcps, new_axes)
        gradients = changes / _FINITE_DIFFERENCE_STEP
        # If a range limit determines the slack, the slack changes only with the joint at the limit.
        states = np.flatnonzero(pairs.slack < np.minimum(pairs.pair_slack, pairs.tilt_slack))
        if len(states):
            joints = np.argmin(self._compute_range_slack(qs[states]), axis=1)
            middle = (self.kinematics.joint_range.lower + self.kinematics.joint_range.upper) / 2
            gradients[states] = 0.0
            gradients[states, joints] = -np.sign((qs - middle)[states, joints])
        return gradients

    def _compute_range_slack(self, qs: Array) -> Array:
        """Return the distance of each joint from its limits, minus `JOINT_RANGE_MARGIN`, `(N, n)` [rad]."""
        return -self.kinematics.joint_range.shrink(JOINT_RANGE_MARGIN).compute_excess(qs)


class Optimizer:
    """Optimizer of the motion between two states.

    Args:
        problem: Start and constraints of the motion.
        candidate: End of the motion.
        qs: Samples `(M, n)` [rad] of a motion that stops at via points, at `SAMPLE_FRACTIONS`.
        duration: Duration of the motion that stops at via points [s].

    Attributes:
        candidate: End of the motion.
        cost: Duration of the best motion, plus the cost of its violated constraints [s].

    Raises:
        JointLimitError: The initial motion cannot be approximated within the joint limits.
    """

    def __init__(self, problem: MotionProblem, candidate: Candidate, qs: Array, duration: float) -> None:
        self.candidate = candidate
        self._problem = problem
        limits = problem.connector.limits
        self._transcription = Transcription(problem.start, candidate.free_part_end, limits)
        for fraction in INITIAL_DURATION_FRACTIONS:
            motion = self._transcription.fit(fraction * duration / STEP_COUNT, qs)
            if motion is not None:
                break
        else:
            raise JointLimitError("no motion inside the limits approximates the motion with via points")
        self._best_motion = motion
        self._trust_radius = INITIAL_TRUST_RADIUS
        self.cost = self._last_cost = math.inf
        self._has_converged = False
        self._payload_constraints: list[LinearizedConstraints] = []
        self._set_iterate(motion)

    def improve(self, max_step_count: int) -> None:
        """Take up to `max_step_count` optimization steps, fewer if the optimization converges."""
        for _ in range(max_step_count):
            if self._has_converged:
                return
            samples = np.flatnonzero(self._nearest_pairs.slack < MAX_SLACK)
            pairs = self._nearest_pairs.select(samples)
            gradients = self._problem.compute_gradients(self._iterate.qs[samples], pairs)
            distance_constraints = LinearizedConstraints(
                pairs.slack, samples[:, None], gradients[:, None], np.zeros(len(samples))
            )
            constraints = [distance_constraints, *self._payload_constraints]
            motion = self._transcription.solve_subproblem(self._iterate, constraints, self._trust_radius)
            if motion is None:
                return
            self._trust_radius *= TRUST_RADIUS_FACTOR
            self._set_iterate(motion)

    def _set_iterate(self, motion: DiscreteMotion) -> None:
        self._iterate = motion
        self._nearest_pairs = self._problem.find_nearest_pairs(motion.qs)
        violations = [-float(self._nearest_pairs.slack.min())]
        if self._problem.payload is not None:
            sample_time = motion.step_duration / SAMPLES_PER_STEP
            constraints = self._problem.payload.linearize(motion.qs, sample_time, MAX_SLACK)
            violations.append(-float(constraints.slack.min(initial=MAX_SLACK)))
            self._payload_constraints = [constraints]
        cost = motion.duration + VIOLATION_COST * max(0.0, *violations)
        self._has_converged = abs(cost - self._last_cost) < CONVERGENCE_TOLERANCE
        self._last_cost = cost
        if cost < self.cost:
            self._best_motion = motion
            self.cost = cost

    def connect_states(self, *, keeps_timing: bool) -> tuple[PointToPoint, ...]:
        """Return the best motion as point-to-point motions between its states.

        Args:
            keeps_timing: True to connect the states at the ends and in the middle of the steps with the
                timing of the best motion. False to connect the states at the ends of the steps in minimum
                time; the path then differs slightly.

        Raises:
            JointLimitError: No motion connects two of the states.
        """
        connector = self._problem.connector
        states = []
        for state in self._transcription.compute_states(self._best_motion)[:: 1 if keeps_timing else 2]:
            # While an acceleration `a` falls to 0 with the maximum jerk `j`, it changes the velocity by
            # `a² / (2 j)`. The velocity is clipped, so that a motion through the state keeps the limits.
            max_velocity = connector.limits.velocity - state.qdd**2 / (2 * connector.limits.jerk)
            states.append(state._replace(qd=np.clip(state.qd, -max_velocity, max_velocity)))
        min_duration = self._best_motion.step_duration / 2 if keeps_timing else None
        return tuple(connector.connect(*ends, min_duration) for ends in pairwise(states))
