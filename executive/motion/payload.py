"""Acceleration limit due to the load: the seal of the suction cup must hold with a safety factor."""

from __future__ import annotations

import math

import numpy as np

from executive.cell.objects import Load
from executive.cell.protocols import STEP
from executive.geometry import GRAVITY, Array
from executive.motion.joints import Kinematics
from executive.motion.trajectory import Trajectory
from executive.motion.transcription import SAMPLES_PER_STEP, LinearizedConstraints

SAFETY_FACTOR = 2.0
"""Ratio of the maximum force that a seal withstands to the largest force on the seal during a motion."""
DISTANCE_PER_ACCELERATION = 0.02
"""Factor that converts accelerations to distances in the constraints of the optimizer [m per m/s²]."""
SAMPLE_STRIDE = 4
"""Every `SAMPLE_STRIDE`-th sample has a constraint; a divisor of `SAMPLES_PER_STEP`."""
_SECOND_DIFFERENCE = np.array([1.0, -2.0, 1.0])  # Product with three samples: acceleration * sample_time²
_FINITE_DIFFERENCE_STEP = 1e-4  # [rad]
MIN_LIFT_ACCELERATION = 0.5
"""Lower limit of the maximum acceleration of a lift, even if the seal withstands less [m/s²]."""
MIN_ACCELERATION_FRACTION = 0.2
"""Minimum fraction of the planned accelerations after a slowdown, even if the seal withstands less."""


class PayloadLimit:
    """Acceleration limit of a load, whose seal must withstand weight and inertia with the safety factor.

    The force on the seal is `m |a + g|`, with the mass `m` of the load, the acceleration `a` of its centre,
    and `g` = 9.81 m/s² upwards.
    """

    def __init__(self, load: Load, kinematics: Kinematics) -> None:
        # Maximum of |a + g| [m/s²].
        self._max_specific_force = load.holding_force / SAFETY_FACTOR / load.object_class.mass
        self._centre_offset = load.object_class.height / 2
        self._kinematics = kinematics

    @property
    def max_lift_acceleration(self) -> float:
        """Maximum upward acceleration [m/s²]."""
        return max(self._max_specific_force - GRAVITY, MIN_LIFT_ACCELERATION)

    def find_acceleration_fraction(self, trajectory: Trajectory) -> float:
        """Return the largest factor, 0 to 1, on the accelerations with which the safety factor holds."""
        centres = self._locate_load(trajectory.samples.q)
        if len(centres) < 4:
            return 1.0
        # The interval before the last sample is shorter than a control step.
        acceleration = np.diff(centres[:-1], n=2, axis=0) / STEP**2
        return float(np.min(_find_acceleration_fractions(acceleration, self._max_specific_force)))

    def make_safe_motion(self, trajectory: Trajectory) -> Trajectory:
        """Return the motion, slowed down so that it keeps the safety factor if possible."""
        fraction = self.find_acceleration_fraction(trajectory)
        # Accelerations are proportional to the square of the speed.
        speed_factor = math.sqrt(max(fraction, MIN_ACCELERATION_FRACTION))
        return trajectory if fraction >= 1 else trajectory.make_slower_copy(speed_factor)

    def linearize(self, qs: Array, sample_time: float, max_slack: float) -> LinearizedConstraints:
        """Return the constraints that keep the seal closed, linearized about a motion.

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
        slack, samples, acceleration = slack[is_close], samples[is_close], acceleration[is_close]
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


def _find_acceleration_fractions(accelerations: Array, max_specific_force: float) -> Array:
    """Return the largest factors `k` `(N,)`, 0 to 1, that keep `|k a + g|` within its maximum [m/s²].

    With accelerations `a` `(N, 3)` and maximum `f`, `k` solves `k² (a a) + 2 k (a g) + g g - f² = 0`.
    """
    a_a = np.sum(accelerations**2, axis=1) + 1e-12
    a_g = GRAVITY * accelerations[:, 2]
    discriminant = a_g**2 - a_a * (GRAVITY**2 - max_specific_force**2)
    fractions = (np.sqrt(np.maximum(discriminant, 0.0)) - a_g) / a_a
    return np.clip(np.where(discriminant < 0, 0.0, fractions), 0.0, 1.0)
