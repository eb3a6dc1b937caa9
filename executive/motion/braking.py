"""Braking along the path: the arm decelerates on its planned path until it is at rest.

Path time is the time parameter of the planned motion `q`. While the arm brakes, the rate of path time falls
from 1 to 0 with limited jerk (ruckig's velocity interface). By the chain rule, the acceleration of the joints
is `q'' rate² + q' rate'`.
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

MIN_BRAKING_TIME = 0.02
"""Shortest time from full speed to rest [s]."""
MAX_BRAKING_TIME = 0.5
"""Longest time from full speed to rest [s]."""
_BRAKING_TIMES = np.geomspace(MIN_BRAKING_TIME, MAX_BRAKING_TIME, 18)  # [s]
_RAMP_FRACTIONS = (1 / 2, 1 / 3)  # fraction of the braking time in which the deceleration rises, or falls


class _BrakingProfile(NamedTuple):
    """Path times [s], rates of path time, and derivatives of the rate [1/s] in `N` control steps."""

    times: Array
    rates: Array
    rate_derivatives: Array


def plan_braking(trajectory: Trajectory, s: float, limits: JointLimits, period: float) -> Array:
    """Return the path times `(N,)` [s] of the control steps from the path time `s` to rest, without `s`.

    The arm either brakes along the path or completes the motion. The result is the shortest candidate within
    the stop limits of joint acceleration and jerk, or else the candidate that exceeds the limits least.

    Args:
        trajectory: Motion of the arm.
        s: Path time at which the arm begins to brake [s].
        limits: Joint limits.
        period: Control period [s].
    """
    best_times, min_peak_fraction = np.array([s]), math.inf
    for profile in _list_profiles(trajectory, s, period):
        peak_fraction = _compute_peak_fraction(trajectory, s, profile, limits, period)
        if peak_fraction <= 1.0:
            return profile.times
        if peak_fraction < min_peak_fraction:
            best_times, min_peak_fraction = profile.times, peak_fraction
    return best_times


def _list_profiles(trajectory: Trajectory, s: float, period: float) -> Iterator[_BrakingProfile]:
    """Yield braking profiles from path time `s` [s], the shortest first."""
    remaining = max(0.0, trajectory.duration - s)
    is_completion_pending = remaining <= MAX_BRAKING_TIME
    for duration in _BRAKING_TIMES:
        if is_completion_pending and remaining <= duration:
            is_completion_pending = False
            count = max(1, math.ceil(remaining / period - 1e-9))
            times = np.minimum(s + period * np.arange(1, count + 1), s + remaining)
            yield _BrakingProfile(times, np.ones(count), np.zeros(count))
        for ramp_fraction in _RAMP_FRACTIONS:
            yield _make_profile(s, float(duration), ramp_fraction, period)


def _make_profile(s: float, duration: float, ramp_fraction: float, period: float) -> _BrakingProfile:
    """Return the profile that brakes from path time `s` [s] to rest within `duration` [s]."""
    inputs = InputParameter(1)
    inputs.control_interface = ControlInterface.Velocity
    inputs.current_position, inputs.current_velocity, inputs.target_velocity = [s], [1.0], [0.0]
    deceleration = 1.0 / (duration * (1 - ramp_fraction))
    inputs.max_acceleration, inputs.max_jerk = [deceleration], [deceleration / (duration * ramp_fraction)]
    profile = Profile(1)
    Ruckig(1).calculate(inputs, profile)
    count = max(1, math.ceil(profile.duration / period - 1e-9))
    samples = [profile.at_time(min(k * period, profile.duration)) for k in range(1, count + 1)]
    return _BrakingProfile(*np.array(samples)[:, :, 0].T)


def _compute_peak_fraction(
    trajectory: Trajectory, s: float, profile: _BrakingProfile, limits: JointLimits, period: float
) -> float:
    """Return the largest joint acceleration or jerk of a braking profile as a fraction of its stop limit."""
    accelerations = [trajectory.state_at(s).qdd]
    for time, rate, rate_derivative in zip(*profile, strict=True):
        _, velocity, acceleration = trajectory.state_at(float(time))
        accelerations.append(acceleration * rate**2 + velocity * rate_derivative)
    accelerations.append(np.zeros_like(accelerations[0]))
    jerks = np.diff(accelerations, axis=0) / period
    fractions = np.abs(accelerations) / limits.stop_acceleration, np.abs(jerks) / limits.stop_jerk
    return float(max(map(np.max, fractions)))
