"""Planned motion of the arm, and braking on the path of a motion.

Ruckig computes the time-optimal, jerk-limited piece between two states. Each joint has its own velocity
profile, and all profiles have the duration of the slowest joint. The path between the states is not
prescribed, so that the caller must check the joint positions on the path.

On braking: path time `s` is the time parameter of the planned motion `q(s)`. While the arm brakes, the rate
`r = ds/dt` falls from 1 to 0 with limited jerk (ruckig's velocity interface). By the chain rule, the
acceleration of the joints is `q_ss r² + q_s dr/dt`; `q_s` and `q_ss` are the derivatives of `q` with respect
to `s`.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from typing import Protocol

import numpy as np
from ruckig import ControlInterface, InputParameter, Result, Ruckig, RuckigError
from ruckig import Trajectory as Profile

from executive.cell.arm import JointState
from executive.cell.device_config import STEP
from executive.errors import Fault, Unreachable
from executive.geometry import Array
from executive.motion.joints import JointLimits

_RELATIVE_TOLERANCE = 1e-9  # fraction of a limit
_MAX_STATE_DIFFERENCE = 1e-6
"""Maximum difference of joint states that count as equal [rad, rad/s, rad/s²]."""
MIN_BRAKING_TIME = 0.02
"""Shortest time from full speed to rest [s]."""
MAX_BRAKING_TIME = 0.5
"""Longest time from full speed to rest [s]."""
RETREAT_TIME = 0.15
"""Path time before a collision to which the arm moves back after the collision [s]."""
MAX_RETREAT_RATE = 0.75
"""Largest rate at which the arm moves back, as a fraction of the speed of the planned motion."""
_STEP_COUNT_ROUNDING = 1e-9  # fraction of a control period
_BRAKING_TIMES = np.geomspace(MIN_BRAKING_TIME, MAX_BRAKING_TIME, 18)
"""Candidates for the time from full speed to rest, the shortest first [s]."""
_RAMP_FRACTIONS = (1 / 2, 1 / 3)
"""Candidates for the duration of each ramp of the deceleration, as fractions of the braking time."""


class JointLimitError(ValueError):
    """No motion within the joint limits exists, or a motion exceeds a limit."""


class MotionPiece(Protocol):
    """A piece of a motion, from time 0 to its duration."""

    @property
    def duration(self) -> float:
        """Duration [s]."""

    def state_at(self, time: float) -> JointState:
        """Return the state at `time`, 0 to `duration` [s]."""

    def sample(self, times: Array) -> JointState:
        """Return the states at `times` `(N,)` [s], each array of shape `(N, n)`."""


class PointToPoint:
    """A motion between two joint states; implements `MotionPiece`."""

    def __init__(self, profile: Profile) -> None:
        self._profile = profile
        self.duration: float = profile.duration

    def state_at(self, time: float) -> JointState:
        """Return the state at `time`."""
        return JointState(*map(np.array, self._profile.at_time(time)))

    def sample(self, times: Array) -> JointState:
        """Return the states at `times`."""
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
        inputs = self._inputs
        inputs.current_position, inputs.current_velocity, inputs.current_acceleration = vectors[:3]
        inputs.target_position, inputs.target_velocity, inputs.target_acceleration = vectors[3:]
        inputs.minimum_duration = min_duration
        profile = Profile(joint_count)
        try:
            result = self._ruckig.calculate(inputs, profile)
        except (RuckigError, ValueError) as error:
            cause = str(error)
        else:
            if result not in (Result.Working, Result.Finished):
                cause = str(result)
            elif np.any(_find_max_speeds(profile) > (1 + _RELATIVE_TOLERANCE) * self.limits.velocity):
                cause = "the profile exceeds a velocity limit"
            else:
                return PointToPoint(profile)
        states = f"from {start.q.round(4)} to {end.q.round(4)} rad"
        raise JointLimitError(f"ruckig finds no valid profile {states}: {cause}")


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


class Trajectory:
    """A motion of `n` joints, at rest at both ends; implements `executive.cell.arm.Motion`.

    Attributes:
        duration: Time from the start to the final rest [s].
        start, end: Joint positions at the start and at the end, `(n,)` each [rad].
        guarded_start_time: Time from which the tool may touch the target [s]; infinite for no contact.
    """

    def __init__(self, pieces: Sequence[MotionPiece], guarded_start_time: float = math.inf) -> None:
        """Join one or more pieces.

        Raises:
            Fault: A piece does not start in the final state of the previous piece, or an end is not at rest.
        """
        self.guarded_start_time = guarded_start_time
        self._pieces = tuple(pieces)
        self._end_times = tuple(accumulate(piece.duration for piece in pieces))
        self.duration = self._end_times[-1]
        starts = [piece.state_at(0.0) for piece in pieces]
        ends = [piece.state_at(piece.duration) for piece in pieces]
        self.start = starts[0].q
        self.end = ends[-1].q
        self._end_state = ends[-1]
        # One operation for all pairs of states that must be equal: each piece starts where the last one ends.
        states_before = [JointState.at_rest(self.start), *ends]
        states_after = [*starts, JointState.at_rest(self.end)]
        differences = np.abs(np.subtract(states_before, states_after)).max(axis=2)
        pair, quantity = np.unravel_index(np.argmax(differences), differences.shape)
        if not differences[pair, quantity] <= _MAX_STATE_DIFFERENCE:  # Also true for NaN.
            problems = {0: "the start is not at rest", len(pieces): "the end is not at rest"}
            problem = problems.get(int(pair), f"pieces {pair} and {pair + 1} do not meet")
            name = ("position", "velocity", "acceleration")[quantity]
            raise Fault(f"invalid trajectory: {problem}; the joint {name} differs by {differences.max():.2g}")

    def make_slower_copy(self, speed_factor: float) -> Trajectory:
        """Return a copy of the motion whose velocities are multiplied by `speed_factor`, 0 to 1."""
        pieces = [_SlowPiece(piece, speed_factor) for piece in self._pieces]
        return Trajectory(pieces, self.guarded_start_time / speed_factor)

    def state_at(self, time: float) -> JointState:
        """Return the joint state at `time` [s]; the arm is at rest before time 0 and after `duration`."""
        if not math.isfinite(time):  # ruckig would end the process
            problem = f"a trajectory has no state at the time {time}"
            raise Fault(f"{problem}; its times are 0 to {self.duration:.3f} s")
        if time <= 0 or time >= self.duration:
            return JointState.at_rest((self.start if time <= 0 else self.end).copy())
        index = min(bisect_right(self._end_times, time), len(self._pieces) - 1)
        start_time = self._end_times[index - 1] if index else 0.0
        return self._pieces[index].state_at(time - start_time)

    @cached_property
    def samples(self) -> JointState:
        """States at all control steps and at the end, each array of shape `(N, n)`."""
        states = sample_pieces(self._pieces, np.arange(0.0, self.duration, STEP, dtype=np.float64))
        return JointState(*map(np.vstack, zip(states, self._end_state, strict=True)))

    def require_limits(self, limits: JointLimits) -> JointState:
        """Check the limits of every joint, and return the checked states (`samples`).

        Raises:
            Unreachable: A joint would leave its range; the message names the joint.
            JointLimitError: A velocity, acceleration or jerk would exceed its limit.
        """
        states = self.samples
        # The samples are checked, because ruckig's `position_extrema` are too small if a joint turns back
        # (pantor/ruckig issue 215).
        excess = limits.position.compute_excess(states.q)
        row, joint = np.unravel_index(np.argmax(excess), excess.shape)
        if excess[row, joint] > _MAX_STATE_DIFFERENCE:
            raise Unreachable(
                f"the motion would take joint {joint + 1} to {math.degrees(states.q[row, joint]):.1f}°; "
                f"its limit is {limits.position.describe(int(joint))}"
            )
        peak_fractions = compute_peak_fractions(states, limits)
        for name, peaks in zip(("velocity", "acceleration", "jerk"), peak_fractions, strict=True):
            joint = np.argmax(peaks)
            if peaks[joint] > 1 + _MAX_STATE_DIFFERENCE:
                message = f"the {name} of joint {joint + 1} would be {peaks[joint]:.3f} times its limit"
                raise JointLimitError(message)
        return states


def sample_pieces(pieces: Sequence[MotionPiece], times: Array) -> JointState:
    """Return the states of consecutive pieces, each array `(N, n)`, at increasing `times` `(N,)` [s]."""
    end_times = [*accumulate(piece.duration for piece in pieces[:-1]), math.inf]
    states = [JointState(*np.empty((3, 0, len(pieces[0].state_at(0.0).q))))]
    start_time = 0.0
    for piece, end_time in zip(pieces, end_times, strict=True):
        piece_times = times[(start_time <= times) & (times < end_time)] - start_time
        if len(piece_times):
            states.append(piece.sample(piece_times))
        start_time = end_time
    return JointState(*map(np.concatenate, zip(*states, strict=True)))


@dataclass(frozen=True, eq=False)
class _SlowPiece:
    """A piece with `speed_factor` (0 to 1) times the velocities of `piece`; implements `MotionPiece`."""

    piece: MotionPiece
    speed_factor: float

    @property
    def duration(self) -> float:
        return self.piece.duration / self.speed_factor

    def state_at(self, time: float) -> JointState:
        return self._scale(self.piece.state_at(time * self.speed_factor))

    def sample(self, times: Array) -> JointState:
        return self._scale(self.piece.sample(times * self.speed_factor))

    def _scale(self, state: JointState) -> JointState:
        return JointState(state.q, self.speed_factor * state.qd, self.speed_factor**2 * state.qdd)


def compute_peak_fractions(states: JointState, limits: JointLimits) -> Array:
    """Return the largest velocity, acceleration and jerk of each joint as fractions of the limits `(3, n)`.

    `states` are the samples of a motion. The jerk before the last sample is ignored, because the last
    interval is shorter than a control period.
    """
    jerk = np.diff(states.qdd, axis=0)[:-1] / STEP
    fractions = (states.qd / limits.velocity, states.qdd / limits.acceleration, jerk / limits.jerk)
    return np.array([np.abs(values).max(axis=0, initial=0.0) for values in fractions])


def downsample_path(qs: Array, max_spacing: float) -> Array:
    """Return points of a path `(N, n)` [rad], between which joints move by up to `max_spacing` [rad]."""
    indices = [0]
    points = qs.tolist()
    for index in range(1, len(qs) - 1):
        if max(abs(a - b) for a, b in zip(points[index + 1], points[indices[-1]], strict=True)) > max_spacing:
            indices.append(index)
    return qs[[*indices, len(qs) - 1]]


def plan_braking(trajectory: Trajectory, start_time: float, limits: JointLimits) -> Array:
    """Return the path times `(N,)` [s] of the control steps after `start_time`, until the arm is at rest.

    The arm either brakes along the path or completes the motion. The result is the shortest candidate within
    the stop limits of joint acceleration and jerk; if no candidate is within the limits, the candidate with
    the smallest excess. The braking begins at path time `start_time` [s].
    """
    best_path_times = np.array([start_time])
    min_peak_fraction = math.inf
    for profile in _list_profiles(trajectory, start_time):
        peak_fraction = _compute_peak_fraction(trajectory, start_time, profile, limits)
        if peak_fraction < min_peak_fraction:
            best_path_times = profile[0]
            min_peak_fraction = peak_fraction
        if peak_fraction <= 1.0:
            break
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


def _list_profiles(trajectory: Trajectory, start_time: float) -> Iterator[Array]:
    """Yield braking profiles and the completion of the motion, the shortest first.

    The rows of a profile `(3, N)` are path time `s` [s], rate `r` and derivative `dr/dt` [1/s] at `N` control
    steps.
    """
    remaining_time = max(0.0, trajectory.duration - start_time)
    completion_index = np.searchsorted(_BRAKING_TIMES, remaining_time)
    for index, braking_time in enumerate(_BRAKING_TIMES.tolist()):
        if index == completion_index:
            step_count = _count_steps(remaining_time)
            end_time = start_time + remaining_time
            path_times = np.minimum(start_time + STEP * np.arange(1, step_count + 1), end_time)
            yield np.array([path_times, np.ones(step_count), np.zeros(step_count)])
        for ramp_fraction in _RAMP_FRACTIONS:
            yield _make_profile(start_time, braking_time, ramp_fraction)


def _count_steps(duration: float) -> int:
    """Return the number of control steps that a duration [s] takes, at least 1."""
    return max(1, math.ceil(duration / STEP - _STEP_COUNT_ROUNDING))


def _make_profile(start_time: float, braking_time: float, ramp_fraction: float) -> Array:
    """Return the profile that brakes from full speed at `start_time` to rest within `braking_time` [s]."""
    inputs = InputParameter(1)
    inputs.control_interface = ControlInterface.Velocity
    inputs.current_position = [start_time]
    inputs.current_velocity = [1.0]
    inputs.target_velocity = [0.0]
    deceleration = 1.0 / (braking_time * (1 - ramp_fraction))
    inputs.max_acceleration = [deceleration]
    inputs.max_jerk = [deceleration / (braking_time * ramp_fraction)]
    profile = Profile(1)
    Ruckig(1).calculate(inputs, profile)
    times = (step * STEP for step in range(1, _count_steps(profile.duration) + 1))
    samples = [profile.at_time(min(time, profile.duration)) for time in times]
    return np.array(samples)[:, :, 0].T


def _compute_peak_fraction(
    trajectory: Trajectory, start_time: float, profile: Array, limits: JointLimits
) -> float:
    """Return the largest joint acceleration or jerk of a braking profile as a fraction of its stop limit."""
    accelerations = [trajectory.state_at(start_time).qdd]
    for path_time, rate, rate_derivative in zip(*profile, strict=True):
        _, velocity, acceleration = trajectory.state_at(float(path_time))
        accelerations.append(acceleration * rate**2 + velocity * rate_derivative)
    accelerations.append(np.zeros_like(accelerations[0]))
    jerks = np.diff(accelerations, axis=0) / STEP
    fractions = (np.abs(accelerations) / limits.stop_acceleration, np.abs(jerks) / limits.stop_jerk)
    return float(max(map(np.max, fractions)))
