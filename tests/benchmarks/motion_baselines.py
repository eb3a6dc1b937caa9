"""Other methods to move between the same positions as the planner, and a lower bound of the duration.

Two methods follow the path of textbooks: up to the cell's travel height, across, and straight down. One stops
at every waypoint; the other follows a spline through the waypoints, timed by TOPP-RA. The lower bound ignores
all obstacles, so that no motion without collisions is faster.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from toppra import SplineInterpolator
from toppra.algorithm import TOPPRA
from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint

from executive.cell.arm import Goal
from executive.cell.clock import STEP
from executive.geometry import Array
from executive.motion.arm_model import Kinematics
from executive.motion.configurations import find_configuration_pairs, find_vertical_waypoints
from executive.motion.joints import JointLimits, JointState, compute_min_time
from executive.motion.point_to_point import Connector
from executive.motion.trajectory import Trajectory
from tests.motion.joint_states import reach

PairMotion = tuple[float, list[JointState]]
"""Total duration of the two motions of a pair [s], and the joint states of each motion every 1/240 s."""


WaypointPair = tuple[Array, Array]
"""Waypoints of the textbook path, joint positions `(4, 7)` [rad]: at the start, above the start, above the
object and at the object; then at the object, above the object, above the bin slot and at the bin slot."""


def find_waypoints(
    kinematics: Kinematics, limits: JointLimits, start: Array, touch: Goal, drop: Goal, height: float
) -> WaypointPair:
    """Return the waypoints at travel height `height` [m] that can be passed, with stops, in the least time.

    Args:
        kinematics: Kinematics of the arm.
        limits: Joint limits of the arm.
        start: Joint positions of the arm at the start `(7,)` [rad].
        touch: Goal at which the tool touches the object.
        drop: Goal at which the tool releases the object.
        height: Travel height of the tool in the world frame [m].

    Raises:
        Unreachable: A waypoint is out of reach.
    """
    x, y, z = kinematics.compute_tool_pose(start).position.tolist()
    line = find_vertical_waypoints(kinematics, start, max(0.0, height - z))
    up = reach(kinematics, (x, y, height), start) if line is None else line[-1]
    fetch = find_configuration_pairs(kinematics, touch, height - touch.position[2], start)
    carry = find_configuration_pairs(kinematics, drop, height - drop.position[2], start)
    fetching = compute_min_time(fetch.upper_qs - up, limits) + 2 * compute_min_time(
        fetch.upper_qs - fetch.lower_qs, limits
    )
    carrying = compute_min_time(carry.upper_qs - fetch.upper_qs[:, None], limits)
    carrying += compute_min_time(carry.lower_qs - carry.upper_qs, limits)
    i, j = np.unravel_index(np.argmin(fetching[:, None] + carrying), carrying.shape)
    return (
        np.array([start, up, fetch.upper_qs[i], fetch.lower_qs[i]]),
        np.array([fetch.lower_qs[i], fetch.upper_qs[i], carry.upper_qs[j], carry.lower_qs[j]]),
    )


def plan_with_stops(waypoints: Array, limits: JointLimits) -> tuple[float, JointState]:
    """Return the time [s] and the states of the motion that rests at every waypoint (ruckig)."""
    connector = Connector(limits)
    motion = Trajectory(
        [connector.connect(JointState.at_rest(a), JointState.at_rest(b)) for a, b in pairwise(waypoints)]
    )
    return motion.duration, motion.samples


def plan_with_toppra(waypoints: Array, limits: JointLimits) -> tuple[float, JointState]:
    """Return the least time [s] along a spline through waypoints, and the states.

    The natural cubic spline is parametrized by chord length in joint space; of the usual parametrizations, it
    takes the least time. TOPP-RA (Pham & Pham, IEEE T-RO 34 (2018), 645-659) follows it at the limits of
    velocity and acceleration; without a limit of jerk, no arm can follow it exactly.
    """
    lengths = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
    # The parameter must increase strictly, even between two equal waypoints.
    path = SplineInterpolator(
        np.concatenate([[0.0], np.cumsum(np.maximum(lengths, 1e-6))]), waypoints, bc_type="natural"
    )
    bounds = [
        JointVelocityConstraint(np.stack([-limits.velocity, limits.velocity], axis=1)),
        JointAccelerationConstraint(np.stack([-limits.acceleration, limits.acceleration], axis=1)),
    ]
    motion: Any = TOPPRA(bounds, path, solver_wrapper="seidel").compute_trajectory(0, 0)
    times = np.append(np.arange(0.0, motion.duration, STEP), motion.duration)
    return float(motion.duration), JointState(motion(times), motion(times, 1), motion(times, 2))


def find_lower_bound(
    kinematics: Kinematics, limits: JointLimits, start: Array, touch: Goal, drop: Goal
) -> PairMotion:
    """Return the fastest motions if all obstacles are ignored.

    Each of the two motions is from rest to rest, without a waypoint. Joint 7 is free at both ends; IK branch
    and swivel are those with the least total time.
    """
    touching, dropping = (
        find_configuration_pairs(kinematics, goal, 0.0, start).lower_qs for goal in (touch, drop)
    )
    there = compute_min_time(touching - start, limits)
    back = compute_min_time(touching[:, None] - dropping, limits)
    i, j = np.unravel_index(np.argmin(there[:, None] + back), back.shape)
    motions = [
        plan_with_stops(np.array(ends), limits) for ends in pairwise((start, touching[i], dropping[j]))
    ]
    return sum(duration for duration, _ in motions), [states for _, states in motions]
