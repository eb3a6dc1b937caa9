"""Motions of the planner compared with other ways to move between the same random places.

A pair consists of a motion from a bin to an object and a motion from there into a bin; each pair starts where
the last one ended. Every method begins a pair in the posture in which the planner's own motion left the arm.
There are no physics: the positions of the objects are known exactly, and the arm is taken to move as planned.

Two methods follow the path of textbooks: up to the cell's travel height, across, and straight down. One stops
at every waypoint; the other follows a spline through the waypoints, timed by TOPP-RA. The lower bound ignores
all obstacles, so that no motion without collisions is faster.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple, TypeVar

import numpy as np
from toppra import SplineInterpolator
from toppra.algorithm import TOPPRA
from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint

from executive.cell.arm import Goal, JointState
from executive.cell.config import CellConfig
from executive.cell.device_config import STEP
from executive.errors import Blocked, Unreachable
from executive.geometry import Array
from executive.motion.configurations import find_configuration_pairs, find_vertical_waypoints
from executive.motion.joints import JointLimits, Kinematics
from executive.motion.planner import Planner
from executive.motion.trajectory import Connector, Trajectory, compute_peak_fractions, plan_braking
from tests.benchmarks.motion_scenes import Scene, SceneGenerator, open_world
from tests.benchmarks.report import Figures, run_command, show_progress
from tests.motion.joint_states import reach

T = TypeVar("T")


class PairMotion(NamedTuple):
    """Duration of the motions of a pair [s], their joint states every 1/240 s, and planning times [ms]."""

    duration: float
    states: list[JointState]
    planning_times: list[float]


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
    fetching = limits.compute_min_time(fetch.upper_qs - up)
    fetching += 2 * limits.compute_min_time(fetch.upper_qs - fetch.lower_qs)
    carrying = limits.compute_min_time(carry.upper_qs - fetch.upper_qs[:, None])
    carrying += limits.compute_min_time(carry.lower_qs - carry.upper_qs)
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
    there = limits.compute_min_time(touching - start)
    back = limits.compute_min_time(touching[:, None] - dropping)
    i, j = np.unravel_index(np.argmin(there[:, None] + back), back.shape)
    motions = [
        plan_with_stops(np.array(ends), limits) for ends in pairwise((start, touching[i], dropping[j]))
    ]
    return PairMotion(sum(duration for duration, _ in motions), [states for _, states in motions], [])


PEAKS = ("velocity", "acceleration", "jerk")
"""Names of the peaks: largest velocity, acceleration and jerk of a joint, each relative to its limit."""
PEAK_TOLERANCE = 1e-6
"""Rounding error by which a peak may exceed its limit, relative to the limit."""


def measure(cell: CellConfig, seed: int = 0, pairs: int = 200) -> Figures:
    """Measure the motions of the arm of CELL from bin to object to bin, and other ways to move."""
    figures: Figures = {"cell": cell.cell, "pairs": pairs, "seed": seed}
    rows: dict[str, list[PairMotion]] = defaultdict(list)
    problems = []
    height = cell.travel_height
    home = np.radians(cell.arm.poses_deg["home"])
    with open_world(cell) as (world, planner):
        scenes = SceneGenerator(cell, planner, world, seed)
        start = planner.plan(home, scenes.draw().drop).end
        for _ in show_progress(range(pairs), "planned"):
            world.set_joint_positions(home)
            scene = scenes.draw()
            try:
                motion, end = plan_pair(planner, start, scene)
            except (Blocked, Unreachable) as error:
                problems.append(f"not planned: {error}")
                continue
            if not rows:
                compare_methods(planner, start, scene, height)  # The first call compiles; do not time it.
            rows["ours"].append(motion)
            for method, other_motion in compare_methods(planner, start, scene, height).items():
                rows[method].append(other_motion)
            start = end
        methods = [summarize(method, motions, planner.limits) for method, motions in rows.items()]
    for row in methods:
        row["ratio_to_lower_bound"] = row["time_s"] / methods[-1]["time_s"]
    problems += [f"{name} over its limit" for name in PEAKS if methods[0][name] > 1 + PEAK_TOLERANCE]
    return {**figures, "planned_pairs": len(rows["ours"]), "methods": methods, "problems": problems}


def plan_pair(planner: Planner, start: Array, scene: Scene) -> tuple[PairMotion, Array]:
    """Return both motions of a pair, and the posture in which they leave the arm.

    On contact the arm brakes along the approach; the transit begins where the arm comes to rest.
    """
    approach, approach_ms = _call_timed(planner.plan, start, scene.approach, scene.fetch_task)
    tips, _ = planner.kinematics.compute_tcps_and_axes(approach.samples.q)
    above = int(np.flatnonzero(tips[:, 2] > scene.contact_height)[-1])
    touched = min((above + 1) * STEP, approach.duration)
    stop = plan_braking(approach, touched, planner.limits)
    grasp = approach.state_at(float(stop[-1])).q
    task = scene.make_carry_task(scene.breakaway_force)
    transit, transit_ms = _call_timed(planner.plan, grasp, scene.drop, task)
    duration = touched + len(stop) * STEP + transit.duration
    states = [approach.samples, transit.samples]
    return PairMotion(duration, states, [approach_ms, transit_ms]), transit.end


def compare_methods(planner: Planner, start: Array, scene: Scene, height: float) -> dict[str, PairMotion]:
    """Return the motions of the other methods between the same positions; the last one is the lower bound."""
    limits = planner.limits
    waypoints = find_waypoints(planner.kinematics, limits, start, scene.touch, scene.drop, height)
    motions = {}
    for method, follow in (("stops at waypoints", plan_with_stops), ("TOPP-RA", plan_with_toppra)):
        followed, times = zip(*[_call_timed(follow, path, limits) for path in waypoints], strict=True)
        duration = sum(duration for duration, _ in followed)
        motions[method] = PairMotion(duration, [states for _, states in followed], list(times))
    lower_bound = find_lower_bound(planner.kinematics, limits, start, scene.touch, scene.drop)
    return {**motions, "lower bound": lower_bound}


def _call_timed(plan: Callable[..., T], *args: Any) -> tuple[T, float]:
    """Return the result of `plan`, and its planning time [ms]."""
    began = time.perf_counter()
    result = plan(*args)
    return result, (time.perf_counter() - began) * 1e3


def summarize(method: str, motions: Sequence[PairMotion], limits: JointLimits) -> Figures:
    """Return mean duration [s], peaks relative to the limits, and planning times [ms] of a method."""
    states = [one for motion in motions for one in motion.states]
    peaks = np.max([compute_peak_fractions(one, limits).max(axis=1) for one in states], axis=0)
    planning_times = [planning_time for motion in motions for planning_time in motion.planning_times]
    row = {"method": method, "time_s": float(np.mean([motion.duration for motion in motions]))}
    row |= dict(zip(PEAKS, peaks.tolist(), strict=True))
    for name, percent in (("planning_median_ms", 50), ("planning_p99_ms", 99)):
        row[name] = float(np.percentile(planning_times, percent)) if planning_times else None
    return row


if __name__ == "__main__":
    run_command(measure)
