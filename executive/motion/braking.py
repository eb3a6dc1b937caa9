"""Braking along the path: the arm decelerates on its planned path until it is at rest.

Path time `s` is the time parameter of the planned motion `q(s)`. While the arm brakes, the rate `r = ds/dt`
falls from 1 to 0 with limited jerk (ruckig's velocity interface). By the chain rule, the acceleration of the
joints is `q_ss r² + q_s dr/dt`; `q_s` and `q_ss` are the derivatives of `q` with respect to `s`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from ruckig import ControlInterface, InputParameter, Ruckig
from ruckig import Trajectory as Profile

from executive.cell.protocols import STEP
from executive.geometry import Array
from executive.motion.joints import JointLimits
from executive.motion.trajectory import Trajectory

MIN_BRAKING_TIME = 0.02
"""Shortest time from full speed to rest [s]."""
MAX_BRAKING_TIME = 0.5
"""Longest time from full speed to rest [s]."""
RETREAT_TIME = 0.15
"""Path time before a collision to which the arm moves back after the collision [s]."""
MAX_RETREAT_RATE = 0.75
"""Largest rate at which the arm moves back, as a fraction of the speed of the planned motion."""
_ROUNDING_ERROR = 1e-9  # fraction of a control period
_BRAKING_TIMES = np.geomspace(MIN_BRAKING_TIME, MAX_BRAKING_TIME, 18)
"""Candidates for the time from full speed to rest, the shortest first [s]."""
_RAMP_FRACTIONS = (1 / 2, 1 / 3)
"""Candidates for the duration of each ramp of the deceleration, as fractions of the braking time."""


class _BrakingProfile(NamedTuple):
    """Path times `s` [s], rates `r`, and derivatives `dr/dt` [1/s] at `N` control steps, each `(N,)`."""

    path_times: Array
    rates: Array
    rate_derivatives: Array


def plan_braking(trajectory: Trajectory, start_time: float, limits: JointLimits) -> Array:
    """Return the path times `(N,)` [s] of the control steps after `start_time`, until the arm is at rest.

    The arm either brakes along the path or completes the motion. The result is the shortest candidate within
    the stop limits of joint acceleration and jerk; if no candidate is within the limits, the candidate with
    the smallest excess. The braking begins at path time `start_time` [s].
    """
    best_path_times, min_peak_fraction = np.array([start_time]), math.inf
    for profile in _list_profiles(trajectory, start_time):
        peak_fraction = _compute_peak_fraction(trajectory, start_time, profile, limits)
        if peak_fraction <= 1.0:
            return profile.path_times
        if peak_fraction < min_peak_fraction:
            best_path_times, min_peak_fraction = profile.path_times, peak_fraction
    return best_path_times


def plan_retreat(collision_time: float, rest_time: float) -> Array:
    """Return the path times `(N,)` [s] of the control steps of a motion back along the path, rest to rest.

    The motion begins at path time `rest_time` [s], where the arm came to rest after a collision at path time
    `collision_time` [s]. It ends `RETREAT_TIME` before the collision, or at the start of the planned motion.
    """
    path_length = rest_time - max(0.0, collision_time - RETREAT_TIME)
    # The quintic polynomial from 0 to 1 with zero rate and acceleration at both ends has the peak rate 15/8.
    step_count = _count_steps(15 / 8 * path_length / MAX_RETREAT_RATE)
    fractions = np.arange(1, step_count + 1) / step_count
    return np.asarray(rest_time - path_length * fractions**3 * (10 - 15 * fractions + 6 * fractions**2))


def _list_profiles(trajectory: Trajectory, start_time: float) -> Iterator[_BrakingProfile]:
    """Yield braking profiles and the completion of the motion, the shortest first."""
    remaining_time = max(0.0, trajectory.duration - start_time)
    completion_index = np.searchsorted(_BRAKING_TIMES, remaining_time)
    for index, braking_time in enumerate(_BRAKING_TIMES.tolist()):
        if index == completion_index:
            step_count = _count_steps(remaining_time)
            end_time = start_time + remaining_time
            path_times = np.minimum(start_time + STEP * np.arange(1, step_count + 1), end_time)
            yield _BrakingProfile(path_times, np.ones(step_count), np.zeros(step_count))
        for ramp_fraction in _RAMP_FRACTIONS:
            yield _make_profile(start_time, braking_time, ramp_fraction)


def _count_steps(duration: float) -> int:
    """Return the number of control steps that a duration [s] takes, at least 1."""
    return max(1, math.ceil(duration / STEP - _ROUNDING_ERROR))


def _make_profile(start_time: float, braking_time: float, ramp_fraction: float) -> _BrakingProfile:
    """Return the profile that brakes from full speed at `start_time` to rest within `braking_time` [s]."""
    inputs = InputParameter(1)
    inputs.control_interface = ControlInterface.Velocity
    inputs.current_position, inputs.current_velocity, inputs.target_velocity = [start_time], [1.0], [0.0]
    deceleration = 1.0 / (braking_time * (1 - ramp_fraction))
    inputs.max_acceleration, inputs.max_jerk = [deceleration], [deceleration / (braking_time * ramp_fraction)]
    profile = Profile(1)
    Ruckig(1).calculate(inputs, profile)
    times = (step * STEP for step in range(1, _count_steps(profile.duration) + 1))
    samples = [profile.at_time(min(time, profile.duration)) for time in times]
    return _BrakingProfile(*np.array(samples)[:, :, 0].T)


def _compute_peak_fraction(
    trajectory: Trajectory, start_time: float, profile: _BrakingProfile, limits: JointLimits
) -> float:
    """Return the largest joint acceleration or jerk of a braking profile as a fraction of its stop limit."""
    accelerations = [trajectory.state_at(start_time).qdd]
    for path_time, rate, rate_derivative in zip(*profile, strict=True):
        _, velocity, acceleration = trajectory.state_at(float(path_time))
        accelerations.append(acceleration * rate**2 + velocity * rate_derivative)
    accelerations.append(np.zeros_like(accelerations[0]))
    jerks = np.diff(accelerations, axis=0) / STEP
    fractions = np.abs(accelerations) / limits.stop_acceleration, np.abs(jerks) / limits.stop_jerk
    return float(max(map(np.max, fractions)))
