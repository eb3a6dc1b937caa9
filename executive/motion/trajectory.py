"""Planned motion of the arm: pieces that join with equal position, velocity and acceleration."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, pairwise

import numpy as np

from executive.cell.clock import STEP
from executive.errors import Fault, Unreachable
from executive.geometry import Array
from executive.motion.limits import JointLimits
from executive.motion.point_to_point import NoProfile
from executive.motion.state import JointState, Piece

_ROUNDING_ERROR = 1e-6
"""Largest difference of two equal joint states [rad, rad/s, rad/s²]."""


class Trajectory:
    """A motion of all joints, at rest at both ends; implements `cell.arm.Motion`.

    Attributes:
        duration: Time from the start to the final rest [s].
        start: Joint positions at the start `(n,)` [rad].
        end: Joint positions at the end `(n,)` [rad].
        guarded: Time from which a contact of the tool is expected [s]; infinite: none is.
    """

    def __init__(self, pieces: Sequence[Piece], guarded: float = math.inf) -> None:
        """Join one or more pieces.

        Raises:
            Fault: A piece does not start in the final state of the piece before, or an end is not at rest.
        """
        self.guarded = guarded
        self._pieces = tuple(pieces)
        self._ends = tuple(accumulate(piece.duration for piece in pieces))
        self.duration = self._ends[-1]
        first, self._last = pieces[0].at(0.0), pieces[-1].at(pieces[-1].duration)
        self.start, self.end = first.q, self._last.q
        for number, (before, after) in enumerate(pairwise(pieces), start=1):
            _require_same(before.at(before.duration), after.at(0.0), f"pieces {number} and {number + 1}")
        for state, end in ((first, "start"), (self._last, "end")):
            _require_same(state, JointState.rest(state.q), f"rest and the {end} of a trajectory")

    def slow_down(self, rate: float) -> Trajectory:
        """Return the motion on the same path at `rate` times the speed, 0 to 1."""
        return Trajectory([_SlowPiece(piece, rate) for piece in self._pieces], self.guarded / rate)

    def at(self, s: float) -> JointState:
        """Return the joint state at path time `s` [s], at rest before the start and after the end."""
        if not math.isfinite(s):  # ruckig would end the process
            raise Fault(
                f"a trajectory has no state at the time {s}; its times are 0 to {self.duration:.3f} s"
            )
        if s <= 0 or s >= self.duration:
            return JointState.rest((self.start if s <= 0 else self.end).copy())
        number = min(bisect_right(self._ends, s), len(self._pieces) - 1)
        start_time = self._ends[number - 1] if number else 0.0
        return self._pieces[number].at(s - start_time)

    @cached_property
    def samples(self) -> JointState:
        """The states in every control step, and the last state: each array of shape `(N, n)`."""
        states = sample_pieces(self._pieces, np.arange(0.0, self.duration, STEP, dtype=np.float64))
        return JointState(*map(np.vstack, zip(states, self._last, strict=True)))

    def check(self, limits: JointLimits) -> JointState:
        """Check the limits of every joint, and return the checked states (`samples`).

        Raises:
            Unreachable: A joint would leave its range; the text names the joint.
            NoProfile: A velocity, acceleration or jerk would exceed its limit.
        """
        states = self.samples
        # Ruckig's `position_extrema` are too small if a joint turns back (pantor/ruckig issue 215).
        _require_in_range(states.q, limits)
        for name, peaks in zip(("velocity", "acceleration", "jerk"), find_peaks(states, limits), strict=True):
            joint = int(np.argmax(peaks))
            if peaks[joint] > 1 + _ROUNDING_ERROR:
                raise NoProfile(
                    f"the {name} of joint {joint + 1} would be {peaks[joint]:.3f} times its limit"
                )
        return states


def find_peaks(states: JointState, limits: JointLimits) -> Array:
    """Return the largest velocity, acceleration and jerk of each joint as shares of the limits `(3, n)`.

    `states` are the samples of a motion. The jerk before the last sample does not count, because the last
    interval is shorter than a control step.
    """
    jerk = np.diff(states.qdd, axis=0)[:-1] / STEP
    shares = (states.qd / limits.velocity, states.qdd / limits.acceleration, jerk / limits.jerk)
    return np.array([np.abs(share).max(axis=0, initial=0.0) for share in shares])


@dataclass(frozen=True, eq=False)
class _SlowPiece:
    """A piece at a lower rate: its velocities and accelerations follow from the chain rule."""

    piece: Piece
    rate: float

    @property
    def duration(self) -> float:
        return self.piece.duration / self.rate

    def at(self, s: float) -> JointState:
        return self._scale(self.piece.at(s * self.rate))

    def over(self, times: Array) -> JointState:
        return self._scale(self.piece.over(times * self.rate))

    def _scale(self, state: JointState) -> JointState:
        return JointState(state.q, self.rate * state.qd, self.rate**2 * state.qdd)


def thin_out(qs: Array, spacing: float) -> Array:
    """Return a subset of a path `(N, n)` [rad] in which no joint moves farther than `spacing` per step."""
    kept = [0]
    for number in range(1, len(qs) - 1):
        if np.max(np.abs(qs[number + 1] - qs[kept[-1]])) > spacing:
            kept.append(number)
    return qs[[*kept, len(qs) - 1]]


def sample_pieces(pieces: Sequence[Piece], times: Array) -> JointState:
    """Return the states of consecutive pieces at increasing `times` `(N,)` [s], each of shape `(N, n)`."""
    ends = [*accumulate(piece.duration for piece in pieces[:-1]), math.inf]
    states, start = [JointState(*np.empty((3, 0, len(pieces[0].at(0.0).q))))], 0.0
    for piece, end in zip(pieces, ends, strict=True):
        piece_times = times[(start <= times) & (times < end)] - start
        if len(piece_times):
            states.append(piece.over(piece_times))
        start = end
    return JointState(*map(np.concatenate, zip(*states, strict=True)))


def _require_same(state: JointState, other: JointState, description: str) -> None:
    for name, a, b in zip(JointState._fields, state, other, strict=True):
        difference = float(np.max(np.abs(a - b)))
        if difference > _ROUNDING_ERROR:
            raise Fault(f"{description} do not fit together: their {name} differ by {difference:.2g}")


def _require_in_range(qs: Array, limits: JointLimits) -> None:
    excess = limits.position.excess(qs)
    number, joint = np.unravel_index(np.argmax(excess), excess.shape)
    if excess[number, joint] > _ROUNDING_ERROR:
        raise Unreachable(
            f"the motion would take joint {joint + 1} to {math.degrees(qs[number, joint]):.1f}°; "
            f"its limit is {limits.position.describe(int(joint))}"
        )
