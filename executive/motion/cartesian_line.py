"""Straight motion of the tool, up or down, in one branch of the inverse kinematics.

The joint path `q(s)` is a spline through inverse-kinematics solutions; its parameter `s` is the distance that
the tool has moved. `q_s`, `q_ss` and `q_sss` are the derivatives of `q` by `s`. With speed `v`, acceleration
`a` and jerk `j` of the tool, the chain rule gives

    q' = q_s v,  q'' = q_s a + q_ss v²,  q''' = q_s j + 3 q_ss v a + q_sss v³.

The limits of `v`, `a` and `j` keep every joint within its limits on the whole line.
"""

from __future__ import annotations

import math

import numpy as np
from ruckig import InputParameter, Ruckig
from ruckig import Trajectory as Profile
from scipy.interpolate import CubicSpline

from executive.geometry import Array
from executive.motion.limits import JointLimits
from executive.motion.state import JointState

WAYPOINT_COUNT = 4
"""Number of inverse-kinematics solutions along a line."""
MAX_CURVATURE_FRACTION = 0.5
"""Maximum fraction of a joint's acceleration and jerk limits that the terms with q_ss and q_sss may use."""
_LIMIT_FRACTIONS = np.linspace(0.0, 1.0, 33)  # fractions of the length at which joint limits are evaluated
_EPSILON = 1e-9  # [rad/m], [rad/m²], [rad/m³]: avoids a division by 0 for a joint that does not move


class CartesianLine:
    """A straight motion of the tool; implements `executive.motion.state.MotionPiece`.

    At an end where the tool moves, its speed is the largest from which it can stop within the line.

    Args:
        waypoints: Joint positions `(N, n)` [rad] at `N` evenly spaced points of the line, `N` > 3.
        length: Length of the line [m].
        limits: Joint limits.
        speed: Maximum speed of the tool [m/s].
        acceleration: Maximum acceleration of the tool [m/s²].
        starts_in_motion: True if the tool moves at the start.
        ends_in_motion: True if the tool moves at the end; at most one of these two arguments may be True.

    Attributes:
        duration: Duration [s].
        acceleration: Maximum acceleration of the tool [m/s²], also limited by the joints.
    """

    def __init__(
        self,
        waypoints: Array,
        length: float,
        limits: JointLimits,
        speed: float = math.inf,
        acceleration: float = math.inf,
        *,
        starts_in_motion: bool = False,
        ends_in_motion: bool = False,
    ) -> None:
        self._spline = CubicSpline(np.linspace(0.0, length, len(waypoints)), waypoints)
        self._derivatives = [self._spline.derivative(order) for order in (1, 2)]
        max_speed, joint_acceleration, jerk = self._compute_tool_limits(limits, speed, length)
        self.acceleration = acceleration = min(acceleration, joint_acceleration)
        end_speed = _find_max_end_speed(length, max_speed, acceleration, jerk)
        inputs = InputParameter(1)
        inputs.current_position, inputs.target_position = [0.0], [length]
        inputs.current_velocity = [end_speed if starts_in_motion else 0.0]
        inputs.target_velocity = [end_speed if ends_in_motion else 0.0]
        inputs.max_velocity, inputs.max_acceleration, inputs.max_jerk = [max_speed], [acceleration], [jerk]
        self._profile = Profile(1)
        Ruckig(1).calculate(inputs, self._profile)
        self.duration: float = self._profile.duration

    def state_at(self, time: float) -> JointState:
        """Return the state at `time`, 0 to `duration` [s]."""
        (distance,), (speed,), (acceleration,) = self._profile.at_time(time)
        q_s, q_ss = (derivative(distance) for derivative in self._derivatives)
        return JointState(self._spline(distance), q_s * speed, q_s * acceleration + q_ss * speed**2)

    def sample(self, times: Array) -> JointState:
        """Return the states at `times` `(N,)` [s], each array of shape `(N, n)`."""
        samples = np.array([self._profile.at_time(time) for time in times.tolist()])[:, :, 0].T
        distance, (speed, acceleration) = samples[0], samples[1:, :, None]
        q_s, q_ss = (derivative(distance) for derivative in self._derivatives)
        return JointState(self._spline(distance), q_s * speed, q_s * acceleration + q_ss * speed**2)

    def _compute_tool_limits(
        self, limits: JointLimits, speed: float, length: float
    ) -> tuple[float, float, float]:
        """Return the maximum speed [m/s], acceleration [m/s²] and jerk [m/s³] of the tool on the line."""
        q_s, q_ss, q_sss = (
            np.abs(self._spline(_LIMIT_FRACTIONS * length, order)).max(axis=0) for order in (1, 2, 3)
        )
        speeds = (
            limits.velocity / (q_s + _EPSILON),
            # Speed that the tool reaches with its maximum acceleration on the whole line.
            math.sqrt(2 * length * np.min(limits.acceleration / (q_s + _EPSILON))),
            np.sqrt(MAX_CURVATURE_FRACTION * limits.acceleration / (q_ss + _EPSILON)),
            np.cbrt(MAX_CURVATURE_FRACTION / 2 * limits.jerk / (q_sss + _EPSILON)),
        )
        max_speed = min(speed, *(float(np.min(values)) for values in speeds))
        accelerations = (
            (limits.acceleration - q_ss * max_speed**2) / (q_s + _EPSILON),
            MAX_CURVATURE_FRACTION / 2 * limits.jerk / (3 * q_ss * max_speed + _EPSILON),
        )
        acceleration = float(np.min(accelerations))
        jerks = limits.jerk - 3 * q_ss * max_speed * acceleration - q_sss * max_speed**3
        return max_speed, acceleration, float(np.min(jerks / (q_s + _EPSILON)))


def _find_max_end_speed(length: float, max_speed: float, acceleration: float, jerk: float) -> float:
    """Return the largest speed [m/s], up to `max_speed`, from which the tool can stop within `length` [m]."""

    def compute_stopping_distance(speed: float) -> float:
        ramp = speed / acceleration + acceleration / jerk
        return speed / 2 * (ramp if speed >= acceleration**2 / jerk else 2 * math.sqrt(speed / jerk))

    low, high = 0.0, max_speed
    if compute_stopping_distance(high) <= length:
        return high
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if compute_stopping_distance(middle) <= length else (low, middle)
    return low
