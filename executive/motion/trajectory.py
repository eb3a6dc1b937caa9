"""A planned motion of the arm: pieces joined where position, velocity and acceleration agree."""

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

_ROUNDING = 1e-6
"""Difference of joint states that is rounding [rad, rad/s, rad/s²]."""


class Trajectory:
    """A motion of all joints, at rest where it begins and where it ends; implements `cell.arm.Motion`.

    Attributes:
        duration: Time from start to rest [s].
        start: Joint positions where it begins `(n,)` [rad].
        end: Joint positions where it ends `(n,)` [rad].
        guarded: Time from which on the tool is meant to touch something [s]; infinite: never.
    """

    def __init__(self, pieces: Sequence[Piece], guarded: float = math.inf) -> None:
        """Join `pieces`, one or more, each beginning in the state in which the one before it ends.

        Raises:
            Fault: Two of them do not fit together, or it does not begin and end at rest.
        """
        self.guarded = guarded
        self._pieces = tuple(pieces)
        self._ends = tuple(accumulate(piece.duration for piece in pieces))
        self.duration = self._ends[-1]
        self._first, self._last = pieces[0].at(0.0), pieces[-1].at(pieces[-1].duration)
        self.start, self.end = self._first.q, self._last.q
        for number, (before, after) in enumerate(pairwise(pieces), start=1):
            _require_same(before.at(before.duration), after.at(0.0), f"pieces {number} and {number + 1}")
        for state, where in ((self._first, "begins"), (self._last, "ends")):
            _require_same(state, JointState.rest(state.q), f"rest and how a trajectory {where}")

    def slowed(self, rate: float) -> Trajectory:
        """Return the same motion on the same path at `rate` times its speed, 0 to 1."""
        return Trajectory([_Slowed(piece, rate) for piece in self._pieces], self.guarded / rate)

    def at(self, s: float) -> JointState:
        """Return position, velocity and acceleration of the joints at path time `s` [s].

        Before the start and after the end it rests.
        """
        if not math.isfinite(s):  # ruckig would end the process
            raise Fault(f"a trajectory was asked for the time {s}; its times are 0 to {self.duration:.3f} s")
        if s <= 0 or s >= self.duration:
            return JointState.rest((self.start if s <= 0 else self.end).copy())
        number = min(bisect_right(self._ends, s), len(self._pieces) - 1)
        before = self._ends[number - 1] if number else 0.0
        return self._pieces[number].at(s - before)

    @cached_property
    def samples(self) -> JointState:
        """Its states every 1/240 s, the last one included: each array of shape `(N, n)`."""
        states = sample_pieces(
            self._pieces, np.asarray(np.arange(0.0, self.duration, STEP), dtype=np.float64)
        )
        return JointState(*(np.concatenate([a, b[None]]) for a, b in zip(states, self._last, strict=True)))

    def check(self, limits: JointLimits) -> JointState:
        """Make sure that every joint keeps its limits on the way, and return the states it was seen in.

        Raises:
            Unreachable: One would leave its range; the text names it.
            NoProfile: One would be too fast, or accelerated too much or too suddenly.
        """
        states = self.samples
        # Ruckig's `position_extrema` are too small where a joint turns back (pantor/ruckig issue 215).
        _require_inside(states.q, limits)
        for name, share in zip(("velocity", "acceleration", "jerk"), find_peaks(states, limits), strict=True):
            joint = int(np.argmax(share))
            if share[joint] > 1 + _ROUNDING:
                raise NoProfile(
                    f"the {name} of joint {joint + 1} would be {share[joint]:.3f} times its limit"
                )
        return states


def find_peaks(states: JointState, limits: JointLimits) -> Array:
    """Return each joint's largest velocity, acceleration and jerk over its limit `(3, n)`.

    The states are a motion's samples, every `STEP`. The last one is not a whole step after the one before,
    so no jerk is taken from it.
    """
    jerk = np.diff(states.qdd, axis=0)[:-1] / STEP
    shares = (states.qd / limits.velocity, states.qdd / limits.acceleration, jerk / limits.jerk)
    return np.array([np.abs(share).max(axis=0, initial=0.0) for share in shares])


@dataclass(frozen=True, eq=False)
class _Slowed:
    """A piece flown at a lower rate: the chain rule gives its velocities and accelerations."""

    piece: Piece
    rate: float

    @property
    def duration(self) -> float:
        return self.piece.duration / self.rate

    def at(self, s: float) -> JointState:
        return self._slower(self.piece.at(s * self.rate))

    def over(self, times: Array) -> JointState:
        return self._slower(self.piece.over(times * self.rate))

    def _slower(self, state: JointState) -> JointState:
        return JointState(state.q, self.rate * state.qd, self.rate**2 * state.qdd)


def thin_out(qs: Array, spacing: float) -> Array:
    """Return so few positions of a path `(N, n)` [rad] that no joint moves farther than `spacing`."""
    kept = [0]
    for number in range(1, len(qs) - 1):
        if np.max(np.abs(qs[number + 1] - qs[kept[-1]])) > spacing:
            kept.append(number)
    return qs[[*kept, len(qs) - 1]]


def sample_pieces(pieces: Sequence[Piece], times: Array) -> JointState:
    """Return the states that `pieces`, one after the other, pass at rising `times` `(N,)` [s]."""
    count = len(pieces[0].at(0.0).q)
    parts, before = [JointState(*np.empty((3, 0, count)))], 0.0
    for number, piece in enumerate(pieces, start=1):
        end = before + piece.duration if number < len(pieces) else np.inf
        here = times[(before <= times) & (times < end)]
        if len(here):
            parts.append(piece.over(np.asarray(here - before)))
        before = end
    return JointState(*map(np.concatenate, zip(*parts, strict=True)))


def _require_same(one: JointState, other: JointState, what: str) -> None:
    for name, a, b in zip(JointState._fields, one, other, strict=True):
        apart = float(np.max(np.abs(a - b)))
        if apart > _ROUNDING:
            raise Fault(f"{what} do not fit together: their {name} differ by {apart:.2g}")


def _require_inside(qs: Array, limits: JointLimits) -> None:
    excess = limits.position.excess(qs)
    number, joint = (int(index) for index in np.unravel_index(np.argmax(excess), excess.shape))
    if excess[number, joint] > _ROUNDING:
        raise Unreachable(
            f"the motion would take joint {joint + 1} to {math.degrees(qs[number, joint]):.1f}°; "
            f"its limit is {limits.position.describe(joint)}"
        )
