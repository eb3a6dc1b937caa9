"""Other ways to move between the same places, to compare the planner's with.

Two are the textbook's: over every place first, at the cell's travel height, and straight down. One stops at
every corner, the other does not. The third is what no way can beat: straight through everything.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from executive.arm import Goal
from executive.errors import InputError
from executive.geometry import Array, tool_down
from executive.motion.free import Connector
from executive.motion.kinematics import Kinematics
from executive.motion.limits import JointLimits, rest_to_rest
from executive.motion.postures import LIMIT_MARGIN, find_postures, upright_line
from executive.motion.state import State
from executive.motion.trajectory import STEP, Trajectory

AROUND = np.radians(np.arange(-5.0, 5.5, 0.5))
"""Swivels around the best one of the coarse search that the floor tries too [rad]."""


@dataclass(frozen=True, eq=False)
class Ride:
    """How the arm rides from where it stands onto an object and from there to where it drops it.

    Attributes:
        time: Time it takes, at rest on the object but without dwelling there [s].
        states: What the joints do, every 1/240 s of each of its motions.
    """

    time: float
    states: tuple[State, ...]


@dataclass(frozen=True, eq=False)
class Textbook:
    """Where the textbook has the arm pass: two chains of joint positions `(4, 7)` [rad].

    Attributes:
        fetch: Where it stands, above that, above the object, on it.
        carry: On the object, above it, above the place in the bin, there.
    """

    fetch: Array
    carry: Array

    def stopping(self, limits: JointLimits) -> Ride:
        """Return the ride that rests at every corner (ruckig, rest to rest)."""
        connector = Connector(limits)
        motions = [
            Trajectory([connector.connect(State.rest(a), State.rest(b)) for a, b in pairwise(chain)])
            for chain in (self.fetch, self.carry)
        ]
        return Ride(sum(motion.duration for motion in motions), tuple(m.samples for m in motions))


def textbook(
    kinematics: Kinematics, limits: JointLimits, start: Array, touch: Goal, drop: Goal, height: float
) -> Textbook:
    """Return the chains through `height` [m] whose stops at every corner take the least time.

    Args:
        kinematics: The arm's.
        limits: What its joints may do.
        start: Where it stands `(7,)` [rad].
        touch: The tool on the object.
        drop: The tool where it lets go.
        height: Of the tool above every place [m].

    Raises:
        Unreachable: A corner is.
    """
    up = _above(kinematics, start, height)
    fetch = find_postures(kinematics, touch, height - touch.position[2], start)
    carry = find_postures(kinematics, drop, height - drop.position[2], start)
    down_and_up = 2 * rest_to_rest(fetch.high - fetch.low, limits)
    fetching = rest_to_rest(fetch.high - up, limits) + down_and_up
    carrying = rest_to_rest(carry.high - fetch.high[:, None], limits)
    carrying += rest_to_rest(carry.low - carry.high, limits)
    i, j = np.unravel_index(np.argmin(fetching[:, None] + carrying), carrying.shape)
    return Textbook(
        np.array([start, up, fetch.high[i], fetch.low[i]]),
        np.array([fetch.low[i], fetch.high[i], carry.high[j], carry.low[j]]),
    )


def toppra(chain: Array, limits: JointLimits) -> tuple[float, State]:
    """Return the fastest time [s] along a spline through joint positions `(N, 7)` [rad], and the states.

    The path is a natural cubic spline by its length in joint space, which of the usual parameters gives the
    shortest times; it is followed at the limits of velocity and acceleration by TOPP-RA (Pham & Pham,
    IEEE T-RO 34 (2018), 645-659). It knows no limit of jerk: no arm can follow it exactly.

    Raises:
        InputError: The package is not installed.
    """
    try:
        from toppra import SplineInterpolator
        from toppra.algorithm import TOPPRA
        from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint
    except ImportError as error:
        raise InputError(
            'the bench of motion compares with the package "toppra"; install it: uv sync --group dev'
        ) from error
    lengths = np.linalg.norm(np.diff(chain, axis=0), axis=1)
    # Two equal corners would be one; a spline cannot take them at the same length.
    path = SplineInterpolator(
        np.concatenate([[0.0], np.cumsum(np.maximum(lengths, 1e-6))]), chain, bc_type="natural"
    )
    bounds = [
        JointVelocityConstraint(np.stack([-limits.velocity, limits.velocity], axis=1)),
        JointAccelerationConstraint(np.stack([-limits.acceleration, limits.acceleration], axis=1)),
    ]
    motion: Any = TOPPRA(bounds, path, solver_wrapper="seidel").compute_trajectory(0, 0)
    times = np.append(np.arange(0.0, motion.duration, STEP), motion.duration)
    return float(motion.duration), State(motion(times), motion(times, 1), motion(times, 2))


def floor(
    kinematics: Kinematics, limits: JointLimits, start: Array, touch: Goal, drop: Goal
) -> tuple[Ride, float]:
    """Return the fastest ride through everything, and its time where the first posture is free too [s].

    Each of the two motions is from rest to rest, without a corner. Joint 7 is free at both ends; branch and
    swivel are those of the shortest sum: of all swivels by 5 degrees, then by half a degree around the best.
    """
    x, y, z = (float(value) for value in kinematics.forward(start).position)
    search = _Search(kinematics, limits, start)
    touching, dropping, standing = (search.everywhere(goal) for goal in (touch, drop, Goal((x, y, z))))
    here = _Ends(None, start[None], np.zeros(1), np.zeros(1))
    corners = search.shortest(here, touching, dropping)
    free = search.shortest(standing, touching, dropping)
    connector = Connector(limits)
    motions = [Trajectory([connector.connect(State.rest(a), State.rest(b))]) for a, b in pairwise(corners)]
    ride = Ride(sum(motion.duration for motion in motions), tuple(motion.samples for motion in motions))
    return ride, float(sum(rest_to_rest(np.diff(free, axis=0), limits)))


@dataclass(frozen=True, eq=False)
class _Ends:
    """Postures in which a motion may end: joint positions `(N, 7)`, branches `(N,)`, swivels `(N,)` [rad]."""

    goal: Goal | None
    q: Array
    branch: Array
    swivel: Array


class _Search:
    """Looks for the postures of the shortest ride."""

    def __init__(self, kinematics: Kinematics, limits: JointLimits, start: Array) -> None:
        self._kinematics = kinematics
        self._limits = limits
        self._start = start

    def everywhere(self, goal: Goal) -> _Ends:
        """Return the postures of a goal, joint 7 as where the arm stands."""
        found = find_postures(self._kinematics, goal, 0.0, self._start)
        return _Ends(goal, found.low, found.branch, found.swivel)

    def shortest(self, *ends: _Ends) -> Array:
        """Return joint positions `(3, 7)` [rad] of the shortest ride by three sets of ends, then refined."""
        around = [self._around(end, number) for end, number in zip(ends, self._best(*ends), strict=True)]
        return np.array([end.q[number] for end, number in zip(around, self._best(*around), strict=True)])

    def _best(self, begin: _Ends, touch: _Ends, drop: _Ends) -> tuple[int, int, int]:
        """Return the numbers of the postures of the shortest ride by three sets of ends."""
        there = rest_to_rest(touch.q[:, None] - begin.q, self._limits)
        back = rest_to_rest(touch.q[:, None] - drop.q, self._limits)
        j = int(np.argmin(there.min(axis=1) + back.min(axis=1)))
        return int(np.argmin(there[j])), j, int(np.argmin(back[j]))

    def _around(self, ends: _Ends, number: int) -> _Ends:
        """Return the posture of that number and those with the elbow a little to its sides."""
        q, branch, swivel = ends.q[number], int(ends.branch[number]), ends.swivel[number]
        if ends.goal is None:
            return ends
        swivels = swivel + AROUND
        found = self._kinematics.grid(tool_down(ends.goal.position), swivels)[branch]
        found[:, 6] = q[6]
        inside = np.all(np.abs(found) <= self._kinematics.position_limit - LIMIT_MARGIN, axis=1)
        return _Ends(
            ends.goal,
            np.concatenate([q[None], found[inside]]),
            np.full(1 + np.count_nonzero(inside), branch),
            np.concatenate([[swivel], swivels[inside]]),
        )


def _above(kinematics: Kinematics, start: Array, height: float) -> Array:
    """Return joint positions `(7,)` [rad] with the tool above where it is, in its posture if it can."""
    x, y, z = (float(value) for value in kinematics.forward(start).position)
    chain = upright_line(kinematics, start, max(0.0, height - z), 2)
    if chain is not None:
        return chain[-1]
    return kinematics.nearest_solution(tool_down((x, y, height)), start)
