"""Braking along the path: the arm decelerates on its planned path and comes to rest there.

The rate of path time falls from 1 to 0 with limited jerk (ruckig's velocity interface with one degree of
freedom). By the chain rule, the acceleration of the joints is then `q'' rate² + q' rate'`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from ruckig import ControlInterface, InputParameter, Ruckig
from ruckig import Trajectory as Profile

from executive.geometry import Array
from executive.motion.limits import JointLimits
from executive.motion.trajectory import Trajectory

MIN_BRAKING_TIME, MAX_BRAKING_TIME = 0.02, 0.5
"""Range of the time from full rate to rest [s]."""
_BRAKING_TIMES = np.geomspace(MIN_BRAKING_TIME, MAX_BRAKING_TIME, 18)  # [s]
_RAMP_SHARES = (1 / 2, 1 / 3)  # share of the braking time in which the deceleration rises, and again falls


class _Braking(NamedTuple):
    """Path times [s], rates of path time, and changes of the rate [1/s] in `N` control steps, each `(N,)`."""

    times: Array
    rates: Array
    rate_changes: Array


def brake(trajectory: Trajectory, s: float, limits: JointLimits, step: float) -> Array:
    """Return the path times `(N,)` [s] of the control steps after path time `s`; the last state is at rest.

    The result is the shortest braking within the stop limits of joint acceleration and jerk; one candidate
    continues to the end of the motion. If no candidate is within the limits, the result is the candidate that
    exceeds the limits least. `step` is the length of a control step [s].
    """
    best_times, least_load = np.array([s]), math.inf
    for braking in _candidates(trajectory, s, step):
        load = _max_load(trajectory, s, braking, limits, step)
        if load <= 1.0:
            return braking.times
        if load < least_load:
            best_times, least_load = braking.times, load
    return best_times


def _candidates(trajectory: Trajectory, s: float, step: float) -> Iterator[_Braking]:
    """Yield candidates from path time `s` [s], the shortest first."""
    remaining = max(0.0, trajectory.duration - s)
    continues_to_end = remaining <= MAX_BRAKING_TIME
    for duration in _BRAKING_TIMES:
        if continues_to_end and remaining <= duration:
            continues_to_end = False
            count = max(1, math.ceil(remaining / step - 1e-9))
            times = np.minimum(s + step * np.arange(1, count + 1), s + remaining)
            yield _Braking(times, np.ones(count), np.zeros(count))
        for ramp_share in _RAMP_SHARES:
            yield _sample_braking(s, float(duration), ramp_share, step)


def _sample_braking(s: float, duration: float, ramp_share: float, step: float) -> _Braking:
    """Return the control steps of a braking that takes `duration` [s]."""
    inputs = InputParameter(1)
    inputs.control_interface = ControlInterface.Velocity
    inputs.current_position, inputs.current_velocity, inputs.target_velocity = [s], [1.0], [0.0]
    deceleration = 1.0 / (duration * (1 - ramp_share))
    inputs.max_acceleration, inputs.max_jerk = [deceleration], [deceleration / (duration * ramp_share)]
    profile = Profile(1)
    Ruckig(1).calculate(inputs, profile)
    count = max(1, math.ceil(profile.duration / step - 1e-9))
    samples = [profile.at_time(min(k * step, profile.duration)) for k in range(1, count + 1)]
    return _Braking(*np.array(samples)[:, :, 0].T)


def _max_load(trajectory: Trajectory, s: float, braking: _Braking, limits: JointLimits, step: float) -> float:
    """Return the largest joint acceleration or jerk of a braking as a share of its stop limit."""
    accelerations = [trajectory.at(s).qdd]
    for time, rate, rate_change in zip(*braking, strict=True):
        _, velocity, acceleration = trajectory.at(float(time))
        accelerations.append(acceleration * rate**2 + velocity * rate_change)
    accelerations.append(np.zeros_like(accelerations[0]))
    jerks = np.diff(accelerations, axis=0) / step
    shares = np.abs(accelerations) / limits.stop_acceleration, np.abs(jerks) / limits.stop_jerk
    return float(max(map(np.max, shares)))
