"""Straight motion of the tool, up or down, in one branch of the inverse kinematics.

The joint path `q(s)` is a polynomial through inverse-kinematics solutions; its parameter `s` is the distance
that the tool has moved. `q_s`, `q_ss` and `q_sss` are the derivatives of `q` with respect to `s`. With speed
`v`, acceleration `a` and jerk `j` of the tool, the chain rule gives those of the joints:

    q' = q_s v,  q'' = q_s a + q_ss v²,  q''' = q_s j + 3 q_ss v a + q_sss v³.

The limits of `v`, `a` and `j` keep every joint within its limits on the whole line.
"""

from __future__ import annotations

import math

import numpy as np
from ruckig import InputParameter, Ruckig
from ruckig import Trajectory as Profile

from executive.geometry import Array
from executive.motion.joints import JointLimits, JointState

MAX_CURVATURE_FRACTION = 0.5
"""Maximum fraction of a joint's acceleration and jerk limits that the terms with q_ss and q_sss may use."""
_CHECKED_FRACTIONS = np.linspace(0.0, 1.0, 33)  # fractions of the length at which joint limits are evaluated
_MIN_DIVISOR = 1e-9  # [rad/m], [rad/m²], [rad/m³]: avoids a division by 0 for a joint that does not move


class CartesianLine:
    """A straight motion of the tool; implements `executive.motion.trajectory.MotionPiece`.

    At an end where the tool moves, its speed is the highest from which the tool could stop on the line, or
    to which it can accelerate from rest on the line.

    Args:
        waypoints: Joint positions `(N, n)` [rad] at `N` evenly spaced points of the line; the degree of the
            polynomial is `N` - 1.
        length: Length of the line [m].
        limits: Joint limits.
        max_speed: Maximum speed of the tool [m/s].
        max_acceleration: Maximum acceleration of the tool [m/s²].
        starts_in_motion: True if the tool moves at the start; excludes `ends_in_motion`.
        ends_in_motion: True if the tool moves at the end; excludes `starts_in_motion`.

    Attributes:
        max_acceleration: Maximum acceleration of the tool [m/s²], also limited by the joints.
    """

    def __init__(
        self,
        waypoints: Array,
        length: float,
        limits: JointLimits,
        max_speed: float = math.inf,
        max_acceleration: float = math.inf,
        *,
        starts_in_motion: bool = False,
        ends_in_motion: bool = False,
    ) -> None:
        distances = np.linspace(0.0, length, len(waypoints))
        coefficients = np.linalg.solve(np.vander(distances, increasing=True), waypoints)
        self._coefficients = [coefficients]
        """Coefficients `(N - k, n)` of the `k`-th derivative of the joint path, those of low powers first."""
        for _ in range(3):
            coefficients = coefficients[1:] * np.arange(1, len(coefficients))[:, None]
            self._coefficients.append(coefficients)
        speed, acceleration, jerk = self._compute_tool_limits(limits, max_speed, length)
        self.max_acceleration = acceleration = min(max_acceleration, acceleration)
        end_speed = _find_max_end_speed(length, speed, acceleration, jerk)
        inputs = InputParameter(1)
        inputs.current_position, inputs.target_position = [0.0], [length]
        inputs.current_velocity = [end_speed if starts_in_motion else 0.0]
        inputs.target_velocity = [end_speed if ends_in_motion else 0.0]
        inputs.max_velocity, inputs.max_acceleration, inputs.max_jerk = [speed], [acceleration], [jerk]
        self._profile = Profile(1)
        Ruckig(1).calculate(inputs, self._profile)
        self.duration: float = self._profile.duration

    def state_at(self, time: float) -> JointState:
        """Return the state at `time`, 0 to `duration` [s]."""
        (distance,), (speed,), (acceleration,) = self._profile.at_time(time)
        q, q_s, q_ss = (self._compute_derivatives(distance, order) for order in range(3))
        return JointState(q, q_s * speed, q_s * acceleration + q_ss * speed**2)

    def sample(self, times: Array) -> JointState:
        """Return the states at `times` `(N,)` [s], each array of shape `(N, n)`."""
        samples = np.array([self._profile.at_time(time) for time in times.tolist()])[:, :, 0].T
        distance, (speed, acceleration) = samples[0], samples[1:, :, None]
        q, q_s, q_ss = (self._compute_derivatives(distance, order) for order in range(3))
        return JointState(q, q_s * speed, q_s * acceleration + q_ss * speed**2)

    def _compute_derivatives(self, distances: Array | float, order: int) -> Array:
        """Return a derivative of the joint path, of order 0 to 3, at `(M,)` distances [m] as `(M, n)`."""
        coefficients = self._coefficients[order]
        return np.asarray(distances)[..., None] ** np.arange(len(coefficients)) @ coefficients

    def _compute_tool_limits(
        self, limits: JointLimits, max_speed: float, length: float
    ) -> tuple[float, float, float]:
        """Return the maximum speed [m/s], acceleration [m/s²] and jerk [m/s³] of the tool on the line.

        The chain rule in the module docstring is solved for `v`, then for `a`, then for `j`.
        """
        distances = _CHECKED_FRACTIONS * length
        q_s, q_ss, q_sss = (
            np.abs(self._compute_derivatives(distances, order)).max(axis=0) for order in (1, 2, 3)
        )
        max_speeds = (
            limits.velocity / (q_s + _MIN_DIVISOR),
            # Speed that the tool reaches with its maximum acceleration on the whole line.
            math.sqrt(2 * length * np.min(limits.acceleration / (q_s + _MIN_DIVISOR))),
            np.sqrt(MAX_CURVATURE_FRACTION * limits.acceleration / (q_ss + _MIN_DIVISOR)),
            np.cbrt(MAX_CURVATURE_FRACTION / 2 * limits.jerk / (q_sss + _MIN_DIVISOR)),
        )
        speed = min(max_speed, *(float(np.min(values)) for values in max_speeds))
        max_accelerations = (
            (limits.acceleration - q_ss * speed**2) / (q_s + _MIN_DIVISOR),
            MAX_CURVATURE_FRACTION / 2 * limits.jerk / (3 * q_ss * speed + _MIN_DIVISOR),
        )
        acceleration = float(np.min(max_accelerations))
        remaining_jerks = limits.jerk - 3 * q_ss * speed * acceleration - q_sss * speed**3
        return speed, acceleration, float(np.min(remaining_jerks / (q_s + _MIN_DIVISOR)))


def _find_max_end_speed(length: float, max_speed: float, acceleration: float, jerk: float) -> float:
    """Return the largest speed [m/s], up to `max_speed`, from which the tool can stop within `length` [m]."""

    def compute_stopping_distance(speed: float) -> float:
        if speed >= acceleration**2 / jerk:
            stopping_time = speed / acceleration + acceleration / jerk
        else:  # The deceleration does not reach its maximum.
            stopping_time = 2 * math.sqrt(speed / jerk)
        return speed / 2 * stopping_time

    lower, upper = 0.0, max_speed
    if compute_stopping_distance(upper) <= length:
        return upper
    for _ in range(40):
        middle = (lower + upper) / 2
        lower, upper = (middle, upper) if compute_stopping_distance(middle) <= length else (lower, middle)
    return lower
