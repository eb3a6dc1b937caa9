"""The tool in a straight line: a posture of the arm kept while the tool goes up or down.

The joints follow a spline through inverse kinematics, by a path parameter that is the tool's way. How fast
that may grow follows from the chain rule,

    q' = q_s v,  q'' = q_s a + q_ss v²,  q''' = q_s j + 3 q_ss v a + q_sss v³,

with bounds on speed, acceleration and jerk of the tool that keep every joint inside its limits wherever on
the line it is.
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

CHAIN_LENGTH = 4
"""Places along a line that inverse kinematics is asked for."""
MAX_BEND_SHARE = 0.5
"""Share of a joint's acceleration and jerk left to the bend of its path, at most."""
_FINE = np.linspace(0.0, 1.0, 33)


class CartesianLine:
    """A straight way of the tool; implements `executive.motion.state.Piece`.

    An end at which it does not rest is passed at the largest speed that leaves room to rest at the other.

    Args:
        chain: Joint positions `(N, n)` [rad] at N places evenly spread along it, `N` > 3.
        length: Its length [m].
        limits: What the joints may do.
        speed: Largest speed of the tool [m/s].
        acceleration: Largest acceleration of the tool [m/s²].
        enters: Whether it begins in motion.
        leaves: Whether it ends in motion; not both.

    Attributes:
        duration: Time it takes [s].
        acceleration: What the tool is accelerated with at most [m/s²]: what was asked, or what the arm can.
    """

    def __init__(
        self,
        chain: Array,
        length: float,
        limits: JointLimits,
        speed: float = math.inf,
        acceleration: float = math.inf,
        *,
        enters: bool = False,
        leaves: bool = False,
    ) -> None:
        self._spline = CubicSpline(np.linspace(0.0, length, len(chain)), chain)
        self._derivatives = [self._spline.derivative(order) for order in (1, 2)]
        velocity, possible, jerk = self._bounds(limits, speed, length)
        self.acceleration = acceleration = min(acceleration, possible)
        passing = _passing_speed(length, velocity, acceleration, jerk)
        inputs = InputParameter(1)
        inputs.current_position, inputs.target_position = [0.0], [length]
        inputs.current_velocity = [passing if enters else 0.0]
        inputs.target_velocity = [passing if leaves else 0.0]
        inputs.max_velocity, inputs.max_acceleration, inputs.max_jerk = [velocity], [acceleration], [jerk]
        self._profile = Profile(1)
        Ruckig(1).calculate(inputs, self._profile)
        self.duration: float = self._profile.duration

    def at(self, s: float) -> JointState:
        """Return the state at time `s`, 0 to `duration` [s]."""
        (place,), (speed,), (change,) = self._profile.at_time(s)
        first, second = (derivative(place) for derivative in self._derivatives)
        return JointState(self._spline(place), first * speed, first * change + second * speed**2)

    def over(self, times: Array) -> JointState:
        """Return the states at `times` `(N,)` [s], each array of shape `(N, n)`."""
        place, speed, change = np.array([self._profile.at_time(s) for s in times.tolist()])[:, :, 0].T
        first, second = (derivative(place) for derivative in self._derivatives)
        bent = second * speed[:, None] ** 2
        return JointState(self._spline(place), first * speed[:, None], first * change[:, None] + bent)

    def _bounds(self, limits: JointLimits, speed: float, length: float) -> tuple[float, float, float]:
        """Return the tool's largest speed [m/s], acceleration [m/s²] and jerk [m/s³]."""
        slope, bend, twist = (np.abs(self._spline(_FINE * length, order)).max(axis=0) for order in (1, 2, 3))
        tiny = 1e-9  # [rad/m] and so on: a joint that stands still sets no bound
        straight = float(np.min(limits.acceleration / (slope + tiny)))
        velocity = min(
            speed,
            math.sqrt(2 * length * straight),  # so short a way does not make it faster
            float(np.min(limits.velocity / (slope + tiny))),
            float(np.min(np.sqrt(MAX_BEND_SHARE * limits.acceleration / (bend + tiny)))),
            float(np.min(np.cbrt(MAX_BEND_SHARE / 2 * limits.jerk / (twist + tiny)))),
        )
        acceleration = min(
            float(np.min((limits.acceleration - bend * velocity**2) / (slope + tiny))),
            float(np.min(MAX_BEND_SHARE / 2 * limits.jerk / (3 * bend * velocity + tiny))),
        )
        rest = limits.jerk - 3 * bend * velocity * acceleration - twist * velocity**3
        return velocity, acceleration, float(np.min(rest / (slope + tiny)))


def _passing_speed(length: float, velocity: float, acceleration: float, jerk: float) -> float:
    """Return the largest speed [m/s] from which the tool comes to rest within `length` [m]."""

    def way(speed: float) -> float:
        ramp = speed / acceleration + acceleration / jerk
        return speed / 2 * (ramp if speed >= acceleration**2 / jerk else 2 * math.sqrt(speed / jerk))

    low, high = 0.0, velocity
    if way(high) <= length:
        return high
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if way(middle) <= length else (low, middle)
    return low
