"""Motions of the planner compared with other ways to move between the same random places.

A pair consists of a motion from a bin to an object and a motion from there into a bin; each pair starts where
the last one ended. Every method begins a pair in the posture in which the planner's own motion left the arm.
There are no physics: the positions of the objects are known exactly, and the arm is taken to move as planned.

Two methods follow the path of textbooks: up to the cell's travel height, across, and straight down. One stops
at every waypoint; the other follows a spline through the waypoints, timed by TOPP-RA. The lower bound ignores
all obstacles, so that no motion without collisions is faster.

Planning times are CPU times of the thread, which do not count other processes. The arms of two cells are
compared in one process, pair by pair in turn.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing
from itertools import islice, pairwise
from typing import Any, NamedTuple, TypeVar

import numpy as np
from toppra import SplineInterpolator
from toppra.algorithm import TOPPRA
from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint

from executive.campaign.evaluation import load_cells
from executive.cell.arm import Goal, JointState
from executive.cell.config import CellConfig
from executive.cell.device_config import STEP
from executive.errors import Blocked, Unreachable
from executive.geometry import Array
from executive.motion.configurations import find_configuration_pairs, find_vertical_waypoints
from executive.motion.joints import JointLimits, Kinematics
from executive.motion.planner import Planner
from executive.motion.trajectory import Connector, Trajectory, compute_peak_fractions, plan_braking
from tests.benchmarks.motion_scenes import Scene, SceneGenerator, open_world, replace_solver
from tests.benchmarks.report import Figures, run_command, show_progress
from tests.motion.joint_states import reach

T = TypeVar("T")


class PairMotion(NamedTuple):
    """Duration of the motions of a pair [s], their joint states every 1/240 s, and planning times [ms]."""

    duration: float
    states: list[JointState]
    planning_times: list[float]


class Pair(NamedTuple):
    """Planner of a pair, joint positions `(n,)` [rad] at its start, its scene, and its motion.

    If the planner finds no motion, `problem` tells why.
    """

    planner: Planner
    start: Array
    scene: Scene
    motion: PairMotion | None
    problem: str = ""


WaypointPair = tuple[Array, Array]
"""Waypoints of the textbook path, joint positions `(4, n)` [rad]: at the start, above the start, above the
object and at the object; then at the object, above the object, above the bin slot and at the bin slot."""


def find_waypoints(
    kinematics: Kinematics, limits: JointLimits, start: Array, touch: Goal, drop: Goal, height: float
) -> WaypointPair:
    """Return the waypoints at travel height `height` [m] that can be passed, with stops, in the least time.

    Args:
        kinematics: Kinematics of the arm.
        limits: Joint limits of the arm.
        start: Joint positions of the arm at the start `(n,)` [rad].
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

    Each of the two motions is from rest to rest, without a waypoint. The last joint is free at both ends; the
    branches of the inverse kinematics are those with the least total time.
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


def measure(
    cell: CellConfig,
    solver: str | None = None,
    other_solver: str | None = None,
    reference: str | None = None,
    seed: int = 0,
    pairs: int = 200,
) -> Figures:
    """Measure the motions of the arm of CELL from bin to object to bin, and other ways to move.

    `--solver` replaces the solver of the arm. With `--other-solver`, a second planner plans the same pairs.
    With `--reference CELL`, the arm of that cell moves in turn, and the planning times are compared.
    """
    cell = replace_solver(cell, solver)
    figures: Figures = {"cell": cell.cell, "solver": cell.arm.solver, "pairs": pairs, "seed": seed}
    rows: dict[str, list[PairMotion]] = defaultdict(list)
    reference_motions: list[PairMotion] = []
    problems = []
    with ExitStack() as stack:
        all_pairs = stack.enter_context(closing(plan_pairs(cell, seed)))
        reference_pairs: Iterator[Pair] = iter(())
        if reference:
            (reference_cell,) = load_cells((reference,)).values()
            reference_pairs = stack.enter_context(closing(plan_pairs(reference_cell, seed)))
        other_planner = None
        if other_solver:
            _, other_planner = stack.enter_context(open_world(replace_solver(cell, other_solver)))
        for _ in show_progress(range(pairs), "planned"):
            reference_motions += [pair.motion for pair in islice(reference_pairs, 1) if pair.motion]
            pair = next(all_pairs)
            other_pair = try_to_plan(other_planner, pair.start, pair.scene) if other_planner else pair
            problems += [problem for problem in {pair.problem, other_pair.problem} if problem]
            if pair.motion is None or other_pair.motion is None:
                continue
            if not rows:
                compare_methods(pair, cell.travel_height)  # The first call compiles; do not time it.
            rows["ours"].append(pair.motion)
            if other_planner:
                rows[f"ours, {other_solver}"].append(other_pair.motion)
            for method, motion in compare_methods(pair, cell.travel_height).items():
                rows[method].append(motion)
    methods = [summarize(method, motions, pair.planner.limits) for method, motions in rows.items()]
    for row in methods:
        row["ratio_to_lower_bound"] = row["time_s"] / methods[-1]["time_s"]
    if reference:
        reference_ms = compute_mean_planning_time(reference_motions)
        figures[f"planning_mean_ms of {reference}"] = reference_ms
        figures["planning_ratio"] = compute_mean_planning_time(rows["ours"]) / reference_ms
    problems += [f"{name} over its limit" for name in PEAKS if methods[0][name] > 1 + PEAK_TOLERANCE]
    return {**figures, "planned_pairs": len(rows["ours"]), "methods": methods, "problems": problems}


def plan_pairs(cell: CellConfig, seed: int) -> Iterator[Pair]:
    """Yield random pairs, each of which starts where the last motion ended."""
    home = np.radians(cell.arm.poses_deg["home"])
    with open_world(cell) as (world, planner):
        scenes = SceneGenerator(cell, planner, world, seed)
        start = planner.plan(home, scenes.draw().drop).end
        while True:
            world.set_joint_positions(home)
            pair = try_to_plan(planner, start, scenes.draw())
            yield pair
            start = pair.motion.states[-1].q[-1] if pair.motion else start


def try_to_plan(planner: Planner, start: Array, scene: Scene) -> Pair:
    """Return a pair with both motions, or with the reason why there is none."""
    try:
        return Pair(planner, start, scene, plan_pair(planner, start, scene))
    except (Blocked, Unreachable) as error:
        return Pair(planner, start, scene, None, f"not planned: {error}")


def plan_pair(planner: Planner, start: Array, scene: Scene) -> PairMotion:
    """Return both motions of a pair.

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
    return PairMotion(duration, states, [approach_ms, transit_ms])


def compare_methods(pair: Pair, height: float) -> dict[str, PairMotion]:
    """Return the motions of the other methods between the same positions; the last one is the lower bound."""
    planner, start, scene = pair[:3]
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
    began = time.thread_time()
    result = plan(*args)
    return result, (time.thread_time() - began) * 1e3


def compute_mean_planning_time(motions: Sequence[PairMotion]) -> float:
    """Return the mean planning time of a motion [ms]."""
    return float(np.mean([planning_time for motion in motions for planning_time in motion.planning_times]))


def summarize(method: str, motions: Sequence[PairMotion], limits: JointLimits) -> Figures:
    """Return mean duration [s], peaks relative to the limits, and planning times [ms] of a method."""
    states = [one for motion in motions for one in motion.states]
    peaks = np.max([compute_peak_fractions(one, limits).max(axis=1) for one in states], axis=0)
    planning_times = [planning_time for motion in motions for planning_time in motion.planning_times]
    row = {"method": method, "time_s": float(np.mean([motion.duration for motion in motions]))}
    row |= dict(zip(PEAKS, peaks.tolist(), strict=True))
    row["planning_mean_ms"] = compute_mean_planning_time(motions) if planning_times else None
    for name, percent in (("planning_median_ms", 50), ("planning_p99_ms", 99)):
        row[name] = float(np.percentile(planning_times, percent)) if planning_times else None
    return row


if __name__ == "__main__":
    run_command(measure)
