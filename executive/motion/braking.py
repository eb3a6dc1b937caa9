"""Braking along the path: the arm slows down on the way it was going and never leaves it.

Path time itself is braked: its rate goes from 1 to 0 by a jerk-limited profile (ruckig's velocity
interface with one degree of freedom), so the joints pass the same positions, only later. What that
asks of the joints follows from the chain rule, `q'' = path'' rate² + path' rate'`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from ruckig import ControlInterface, InputParameter, Ruckig
from ruckig import Trajectory as Profile

from executive.geometry import Array
from executive.motion.limits import JointLimits
from executive.motion.trajectory import Trajectory

MIN_BRAKING_TIME, MAX_BRAKING_TIME = 0.02, 0.5
"""Range of the time taken from full rate to rest [s]."""
_DURATIONS = np.geomspace(MIN_BRAKING_TIME, MAX_BRAKING_TIME, 18)
_RAMPS = (1 / 2, 1 / 3)  # share of the duration in which the deceleration builds up, and again ebbs away


def brake(trajectory: Trajectory, s: float, limits: JointLimits, step: float) -> Array:
    """Return the path times `(N,)` [s] of the control steps after path time `s`; the last is at rest.

    The shortest stop is taken that keeps joint accelerations and jerks inside the stop limits, at
    control steps of `step` [s]. Running on to the end of the motion is one of the choices. If none is
    inside, the one that exceeds the limits least: braking comes first.
    """
    best, least = np.array([s]), math.inf
    for times, rates, slopes in _candidates(trajectory, s, step):
        load = _load(trajectory, s, (times, rates, slopes), limits, step)
        if load <= 1.0:
            return times
        if load < least:
            best, least = times, load
    return best


def _candidates(trajectory: Trajectory, s: float, step: float) -> Iterator[tuple[Array, Array, Array]]:
    """Yield path times, rates and their slopes `(N,)` of possible stops, shortest first."""
    remaining = max(0.0, trajectory.duration - s)
    coasted = remaining > MAX_BRAKING_TIME
    for duration in _DURATIONS:
        if not coasted and remaining <= duration:
            coasted = True
            count = max(1, math.ceil(remaining / step - 1e-9))
            times = np.minimum(s + step * np.arange(1, count + 1), s + remaining)
            yield times, np.ones(count), np.zeros(count)
        for ramp in _RAMPS:
            yield _profile(s, float(duration), ramp, step)


def _profile(s: float, duration: float, ramp: float, step: float) -> tuple[Array, Array, Array]:
    """Sample a stop of path time that takes `duration` [s]."""
    inputs = InputParameter(1)
    inputs.control_interface = ControlInterface.Velocity
    inputs.current_position, inputs.current_velocity, inputs.target_velocity = [s], [1.0], [0.0]
    deceleration = 1.0 / (duration * (1 - ramp))
    inputs.max_acceleration, inputs.max_jerk = [deceleration], [deceleration / (duration * ramp)]
    profile = Profile(1)
    Ruckig(1).calculate(inputs, profile)
    count = max(1, math.ceil(profile.duration / step - 1e-9))
    samples = [profile.at_time(min(k * step, profile.duration)) for k in range(1, count + 1)]
    times, rates, slopes = (np.array([sample[i][0] for sample in samples]) for i in range(3))
    return times, rates, slopes


def _load(
    trajectory: Trajectory, s: float, stop: tuple[Array, Array, Array], limits: JointLimits, step: float
) -> float:
    """Return the largest joint acceleration or jerk of a stop as a share of its stop limit."""
    accelerations = [trajectory.at(s)[2]]
    for time, rate, slope in zip(*stop, strict=True):
        _, velocity, acceleration = trajectory.at(float(time))
        accelerations.append(acceleration * rate**2 + velocity * slope)
    accelerations.append(np.zeros_like(accelerations[0]))
    array = np.array(accelerations)
    jerks = np.diff(array, axis=0) / step
    return float(
        max(np.max(np.abs(array) / limits.stop_acceleration), np.max(np.abs(jerks) / limits.stop_jerk))
    )
