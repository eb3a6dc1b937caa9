"""Time-optimal, jerk-limited arm trajectories: straight joint moves from rest to rest."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from ruckig import InputParameter, Result, Ruckig, RuckigError, Synchronization
from ruckig import Trajectory as Profile

from executive.errors import Fault, Unreachable
from executive.geometry import Array
from executive.motion.limits import JointLimits
from executive.motion.timing import path_limits

JOINTS = 7
_STILL = 1e-9  # [rad] a smaller change is no move


class Trajectory:
    """A motion of all joints through waypoints, at rest at each, implementing `cell.Motion`.

    Each segment is a straight line in joint space: every joint follows the same profile, scaled.

    Attributes:
        waypoints: Joint positions passed `(N, 7)` [rad], the first where it starts, the last where it ends.
        rests: Path times at which it is at rest, one per waypoint [s].
    """

    def __init__(
        self, waypoints: ArrayLike, limits: JointLimits, rates: Sequence[float] | None = None
    ) -> None:
        """Compute the profiles.

        Args:
            waypoints: `(N, 7)` [rad], `N` > 1.
            limits: Velocity, acceleration and jerk that no joint exceeds.
            rates: Largest rate of each segment's path parameter (0 to 1 over it) [1/s], inf for none.

        Raises:
            Fault: The waypoints have the wrong shape or are not numbers, or ruckig finds no profile.
        """
        self.waypoints = _checked(waypoints)
        rates = [math.inf] * (len(self.waypoints) - 1) if rates is None else rates
        self._profiles: list[Profile | None] = []
        times = [0.0]
        for start, end, rate in zip(self.waypoints[:-1], self.waypoints[1:], rates, strict=True):
            profile = _straight(start, end, limits, rate)
            self._profiles.append(profile)
            times.append(times[-1] + (profile.duration if profile else 0.0))
        self.rests = tuple(times)

    @property
    def duration(self) -> float:
        """Time from start to rest [s]."""
        return self.rests[-1]

    @property
    def start(self) -> Array:
        """Joint positions where it begins `(7,)` [rad]."""
        return self.waypoints[0]

    @property
    def end(self) -> Array:
        """Joint positions where it ends `(7,)` [rad]."""
        return self.waypoints[-1]

    def at(self, s: float) -> tuple[Array, Array, Array]:
        """Return position, velocity and acceleration `(7,)` of the joints at path time `s` [s].

        Before the start and after the end it rests.
        """
        if not math.isfinite(s):  # ruckig would end the process
            raise Fault(f"a trajectory was asked for the time {s}; its times are 0 to {self.duration:.3f} s")
        segment = min(bisect_right(self.rests, s), len(self._profiles)) - 1
        profile = self._profiles[max(segment, 0)]
        if profile is None or s <= 0 or s >= self.duration:
            return (self.start if s <= 0 else self.end).copy(), np.zeros(JOINTS), np.zeros(JOINTS)
        q, qd, qdd = profile.at_time(s - self.rests[segment])
        return np.array(q), np.array(qd), np.array(qdd)

    def path(self, spacing: float) -> Array:
        """Return joint positions along the path `(N, 7)` [rad], at most `spacing` apart in any joint."""
        parts = [self.start[None]]
        for start, end in zip(self.waypoints[:-1], self.waypoints[1:], strict=True):
            count = max(1, math.ceil(float(np.max(np.abs(end - start))) / spacing))
            parts.append(start + np.linspace(0, 1, count + 1)[1:, None] * (end - start))
        return np.concatenate(parts)

    def check(self, limits: JointLimits) -> None:
        """Make sure that no joint leaves its range anywhere on the way: ruckig does not look at that.

        Raises:
            Unreachable: One would; the text names it.
        """
        for profile in filter(None, self._profiles):
            bounds = profile.position_extrema
            extremes = np.array([max(abs(bound.min), abs(bound.max)) for bound in bounds])
            _require_inside(extremes, limits)
        _require_inside(np.abs(self.waypoints).max(axis=0), limits)


def _require_inside(extremes: Array, limits: JointLimits) -> None:
    excess = extremes - limits.position
    joint = int(np.argmax(excess))
    if excess[joint] > _STILL:
        raise Unreachable(
            f"the motion would take joint {joint + 1} to {math.degrees(extremes[joint]):.1f}°; "
            f"its limit is ±{math.degrees(limits.position[joint]):.0f}°"
        )


def _checked(waypoints: ArrayLike) -> Array:
    """Return the waypoints as `(N, 7)` finite numbers: ruckig reads out of bounds on anything else."""
    array = np.array(waypoints, dtype=float)
    if array.ndim != 2 or array.shape[0] < 2 or array.shape[1] != JOINTS:
        raise Fault(
            f"a trajectory needs two waypoints or more of {JOINTS} joints, not the shape {array.shape}"
        )
    if not np.all(np.isfinite(array)):
        row, joint = np.argwhere(~np.isfinite(array))[0]
        raise Fault(f"waypoint {row} of a trajectory has {array[row, joint]} for joint {joint + 1}")
    return array


def _straight(start: Array, end: Array, limits: JointLimits, rate: float) -> Profile | None:
    """Return the profile of one straight joint move, or None where nothing moves."""
    change = end - start
    if np.max(np.abs(change)) < _STILL:
        return None
    if not rate > 0:
        raise Fault(f"the rate of a segment is {rate}; it must be positive")
    inverse = path_limits(change, limits, rate)
    # All joints' limits in proportion to their way: then phase synchronization is always possible and
    # never falls back to a curved path.
    share = np.maximum(np.abs(change), _STILL)
    inputs = InputParameter(JOINTS)
    inputs.synchronization = Synchronization.Phase
    inputs.current_position = start.tolist()
    inputs.target_position = end.tolist()
    inputs.max_velocity = (share / inverse.slowness).tolist()
    inputs.max_acceleration = (share / inverse.sluggishness).tolist()
    inputs.max_jerk = (share / inverse.softness).tolist()
    profile = Profile(JOINTS)
    where = f"from {start.round(4)} to {end.round(4)} rad"
    try:
        result = Ruckig(JOINTS).calculate(inputs, profile)
    except (RuckigError, ValueError) as error:
        raise Fault(f"ruckig finds no profile {where}: {error}") from error
    if result not in (Result.Working, Result.Finished):
        raise Fault(f"ruckig finds no profile {where}: {result}")
    return profile
