"""Time-optimal, jerk-limited motion of all joints from one state to another, by ruckig.

Every joint has a profile of its own; the slowest one decides how long it takes, and the others take as
long. The path between the two states is what results from that, and has to be checked by whoever uses it.
"""

from __future__ import annotations

import math

import numpy as np
from ruckig import InputParameter, Result, Ruckig, RuckigError
from ruckig import Trajectory as Profile

from executive.errors import Fault
from executive.geometry import Array
from executive.motion.limits import JointLimits
from executive.motion.state import JointState

_ROUNDING = 1e-9  # share of a limit


class NoProfile(ValueError):
    """There is no motion inside the limits that begins and ends in the given states."""


class PointToPoint:
    """A motion from state to state; implements `executive.motion.state.Piece`."""

    def __init__(self, profile: Profile) -> None:
        self._profile = profile
        self.duration: float = profile.duration

    def at(self, s: float) -> JointState:
        """Return the state at time `s`, 0 to `duration` [s]."""
        return JointState(*map(np.array, self._profile.at_time(s)))

    def over(self, times: Array) -> JointState:
        """Return the states at `times` `(N,)` [s], each array of shape `(N, n)`."""
        states = np.array([self._profile.at_time(s) for s in times.tolist()])
        return JointState(states[:, 0], states[:, 1], states[:, 2])


class Connector:
    """Finds the fastest motions between states inside the joints' limits of velocity, acceleration, jerk."""

    def __init__(self, limits: JointLimits) -> None:
        self.limits = limits
        self._ruckig = Ruckig(limits.joint_count)
        self._input = InputParameter(limits.joint_count)
        self._input.max_velocity = limits.velocity.tolist()
        self._input.max_acceleration = limits.acceleration.tolist()
        self._input.max_jerk = limits.jerk.tolist()

    def connect(self, start: JointState, end: JointState, least: float | None = None) -> PointToPoint:
        """Return the fastest motion from `start` to `end` that takes `least` [s] or longer.

        Positions are not limited: ruckig does not look at that.

        Raises:
            NoProfile: There is none, for instance because a velocity is outside the limits.
            Fault: A state has not one finite number for each joint: ruckig would read out of bounds or crash.
        """
        count = self.limits.joint_count
        for values in (*start, *end):
            if values.shape != (count,) or not math.isfinite(float(values.sum())):
                raise Fault(f"a motion needs states of {count} finite numbers, not {values}")
        inputs = self._input
        inputs.current_position, inputs.current_velocity, inputs.current_acceleration = (
            values.tolist() for values in start
        )
        inputs.target_position, inputs.target_velocity, inputs.target_acceleration = (
            values.tolist() for values in end
        )
        inputs.minimum_duration = least
        profile = Profile(count)
        try:
            result = self._ruckig.calculate(inputs, profile)
        except (RuckigError, ValueError) as error:
            raise NoProfile(_text(start, end, error)) from error
        if result not in (Result.Working, Result.Finished):
            raise NoProfile(_text(start, end, result))
        if np.any(_fastest(profile) > (1 + _ROUNDING) * self.limits.velocity):
            raise NoProfile(_text(start, end, "the one it found exceeds a velocity limit"))
        return PointToPoint(profile)


def _fastest(profile: Profile) -> Array:
    """Return the largest speed of every joint `(n,)` [rad/s].

    Where an acceleration changes sign within a phase, ruckig does not always look.
    """
    fastest = []
    for joint in profile.profiles[0]:
        turns = [
            v - a * a / (2 * j)
            for v, a, after, j in zip(joint.v, joint.a, joint.a[1:], joint.j, strict=False)
            if a * after < 0
        ]
        fastest.append(max(map(abs, [*joint.v, *turns])))
    return np.array(fastest)


def _text(start: JointState, end: JointState, why: object) -> str:
    return f"ruckig finds no profile from {start.q.round(4)} to {end.q.round(4)} rad: {why}"
