"""Time-optimal, jerk-limited motion of all joints between two states, by ruckig.

Each joint has its own velocity profile, and all profiles have the duration of the slowest joint. The path
between the states is not prescribed, so that the caller must check the joint positions on the path.
"""

from __future__ import annotations

import math

import numpy as np
from ruckig import InputParameter, Result, Ruckig, RuckigError
from ruckig import Trajectory as Profile

from executive.errors import Fault
from executive.geometry import Array
from executive.motion.joints import JointLimits, JointState

_RELATIVE_TOLERANCE = 1e-9  # fraction of a limit


class JointLimitError(ValueError):
    """No motion within the joint limits exists, or a motion exceeds a limit."""


class PointToPoint:
    """A motion between two joint states; implements `executive.motion.trajectory.MotionPiece`."""

    def __init__(self, profile: Profile) -> None:
        self._profile = profile
        self.duration: float = profile.duration

    def state_at(self, time: float) -> JointState:
        """Return the state at `time`, 0 to `duration` [s]."""
        return JointState(*map(np.array, self._profile.at_time(time)))

    def sample(self, times: Array) -> JointState:
        """Return the states at `times` `(N,)` [s], each array of shape `(N, n)`."""
        return JointState(*np.array([self._profile.at_time(time) for time in times.tolist()]).swapaxes(0, 1))


class Connector:
    """Planner of motions between two states within the limits of joint velocity, acceleration and jerk."""

    def __init__(self, limits: JointLimits) -> None:
        self.limits = limits
        self._ruckig = Ruckig(limits.joint_count)
        self._inputs = InputParameter(limits.joint_count)
        self._inputs.max_velocity = limits.velocity.tolist()
        self._inputs.max_acceleration = limits.acceleration.tolist()
        self._inputs.max_jerk = limits.jerk.tolist()

    def connect(self, start: JointState, end: JointState, min_duration: float | None = None) -> PointToPoint:
        """Return the fastest motion from `start` to `end` that takes at least `min_duration` [s].

        The joint positions between the states are not limited.

        Raises:
            JointLimitError: No motion exists, for example because the velocity of a state exceeds its limit.
            Fault: A state lacks a finite number for a joint; ruckig would read out of bounds or crash.
        """
        joint_count = self.limits.joint_count
        vectors = [vector.tolist() for vector in (*start, *end)]
        for vector in vectors:
            if len(vector) != joint_count or not math.isfinite(sum(vector)):
                raise Fault(f"a motion needs states of {joint_count} finite numbers, not {vector}")
        inputs, profile = self._inputs, Profile(joint_count)
        inputs.current_position, inputs.current_velocity, inputs.current_acceleration = vectors[:3]
        inputs.target_position, inputs.target_velocity, inputs.target_acceleration = vectors[3:]
        inputs.minimum_duration = min_duration
        cause: str | None = None
        try:
            result = self._ruckig.calculate(inputs, profile)
        except (RuckigError, ValueError) as error:
            cause = str(error)
        else:
            if result not in (Result.Working, Result.Finished):
                cause = str(result)
            elif np.any(_find_max_speeds(profile) > (1 + _RELATIVE_TOLERANCE) * self.limits.velocity):
                cause = "the profile exceeds a velocity limit"
        if cause is not None:
            states = f"from {start.q.round(4)} to {end.q.round(4)} rad"
            raise JointLimitError(f"ruckig finds no valid profile {states}: {cause}")
        return PointToPoint(profile)


def _find_max_speeds(profile: Profile) -> Array:
    """Return the largest speed of each joint in a profile `(n,)` [rad/s].

    ruckig does not always check the extreme speed `v - a² / 2 j` in a phase with constant jerk `j`, in which
    the acceleration changes its sign.
    """
    max_speeds = []
    for joint in profile.profiles[0]:
        phases = zip(joint.v, joint.a, joint.a[1:], joint.j, strict=False)
        extreme_speeds = [v - a * a / (2 * j) for v, a, next_a, j in phases if a * next_a < 0]
        max_speeds.append(max(map(abs, [*joint.v, *extreme_speeds])))
    return np.array(max_speeds)
