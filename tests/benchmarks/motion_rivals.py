"""Other ways to move between the same places as the planner.

Two are from the textbook: over every place first, at the cell's travel height, and straight down. One stops
at every corner, the other passes with TOPP-RA. The floor is faster than any way: straight through everything.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from toppra import SplineInterpolator
from toppra.algorithm import TOPPRA
from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint

from executive.arm import Goal
from executive.clock import STEP
from executive.geometry import Array
from executive.motion.free import Connector
from executive.motion.kinematics import Kinematics
from executive.motion.limits import JointLimits, rest_to_rest
from executive.motion.postures import find_postures, upright_line
from executive.motion.state import State
from executive.motion.trajectory import Trajectory
from tests.motion.joint_states import reach

Ride = tuple[float, list[State]]
"""Time of the two motions of a pair [s], without a dwell, and the joints' states every 1/240 s of each."""


Chains = tuple[Array, Array]
"""Corners of the textbook's way, joint positions `(4, 7)` [rad]: where the arm stands, above that, above the
object, on it; then on the object, above it, above the place in the bin, there."""


def find_chains(
    kinematics: Kinematics, limits: JointLimits, start: Array, touch: Goal, drop: Goal, height: float
) -> Chains:
    """Return the chains through `height` [m] whose stops at every corner take the least time.

    Args:
        kinematics: The arm's.
        limits: The limits of its joints.
        start: Joint positions where it stands `(7,)` [rad].
        touch: The tool on the object.
        drop: The tool where it lets go.
        height: Height of the tool above every place [m].

    Raises:
        Unreachable: A corner is out of reach.
    """
    x, y, z = kinematics.forward(start).position.tolist()
    line = upright_line(kinematics, start, max(0.0, height - z), 2)
    up = reach(kinematics, (x, y, height), start) if line is None else line[-1]
    fetch = find_postures(kinematics, touch, height - touch.position[2], start)
    carry = find_postures(kinematics, drop, height - drop.position[2], start)
    fetching = rest_to_rest(fetch.high - up, limits) + 2 * rest_to_rest(fetch.high - fetch.low, limits)
    carrying = rest_to_rest(carry.high - fetch.high[:, None], limits)
    carrying += rest_to_rest(carry.low - carry.high, limits)
    i, j = np.unravel_index(np.argmin(fetching[:, None] + carrying), carrying.shape)
    return (
        np.array([start, up, fetch.high[i], fetch.low[i]]),
        np.array([fetch.low[i], fetch.high[i], carry.high[j], carry.low[j]]),
    )


def stop_at_corners(chain: Array, limits: JointLimits) -> tuple[float, State]:
    """Return the time [s] and the states of the motion that rests at every corner of a chain (ruckig)."""
    connector = Connector(limits)
    motion = Trajectory([connector.connect(State.rest(a), State.rest(b)) for a, b in pairwise(chain)])
    return motion.duration, motion.samples


def follow_with_toppra(chain: Array, limits: JointLimits) -> tuple[float, State]:
    """Return the fastest time [s] along a spline through a chain, and the states.

    The path is a natural cubic spline by its length in joint space, which of the usual parameters gives the
    shortest times. TOPP-RA (Pham & Pham, IEEE T-RO 34 (2018), 645-659) follows it at the limits of velocity
    and acceleration; without a limit of jerk, no arm can follow it exactly.
    """
    lengths = np.linalg.norm(np.diff(chain, axis=0), axis=1)
    # A spline cannot take two equal corners at the same length.
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


def find_floor(kinematics: Kinematics, limits: JointLimits, start: Array, touch: Goal, drop: Goal) -> Ride:
    """Return the fastest ride through everything.

    Each of the two motions is from rest to rest, without a corner. Joint 7 is free at both ends; branch and
    swivel are those of the shortest sum.
    """
    touching, dropping = (find_postures(kinematics, goal, 0.0, start).low for goal in (touch, drop))
    there = rest_to_rest(touching - start, limits)
    back = rest_to_rest(touching[:, None] - dropping, limits)
    i, j = np.unravel_index(np.argmin(there[:, None] + back), back.shape)
    motions = [
        stop_at_corners(np.array(ends), limits) for ends in pairwise((start, touching[i], dropping[j]))
    ]
    return sum(duration for duration, _ in motions), [states for _, states in motions]
