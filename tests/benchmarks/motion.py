"""Motions of the planner compared with other ways to move between the same random places.

A pair consists of a motion from a bin to an object and a motion from there into a bin; each pair starts where
the last one ended. Every method begins a pair in the posture in which the planner's own motion left the arm.
There are no physics: the positions of the objects are known exactly, and the arm is taken to move as planned.
With `--execute` the simulated arm makes the planner's motions instead (`motion_execution.py`).
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import click
import numpy as np

from executive.cell.clock import STEP
from executive.cell.config import CellConfig
from executive.cell.layout import compute_travel_height
from executive.cells.sim.world import World
from executive.errors import Blocked, InputError, Unreachable
from executive.geometry import Array
from executive.motion.braking import plan_braking
from executive.motion.joints import JointState
from executive.motion.planner import Planner
from executive.motion.trajectory import Trajectory, compute_peak_fractions
from tests.benchmarks import motion_baselines as baselines
from tests.benchmarks.motion_execution import execute_pairs
from tests.benchmarks.motion_scenes import Scene, SceneGenerator, open_world
from tests.benchmarks.report import CELL_OPTIONS, Figures, run_command, show_progress

T = TypeVar("T")
PEAKS = ("velocity", "acceleration", "jerk")
"""Names of the peaks: largest velocity, acceleration and jerk of a joint, each relative to its limit."""
PEAK_TOLERANCE = 1e-6
"""Rounding error by which a peak may exceed its limit, relative to the limit."""


def measure(cell: CellConfig, seed: int = 0, pairs: int = 200, execute: bool = False) -> Figures:
    """Measure the motions of the arm of CELL from bin to object to bin, and other ways to move."""
    if execute:
        return {"cell": cell.cell, "pairs": pairs, "seed": seed, **execute_pairs(cell, pairs, seed)}
    with open_world(cell) as (world, planner):
        comparison = _MethodComparison(cell, world, planner, seed)
        for _ in show_progress(range(pairs), "planned"):
            comparison.plan_pair()
        return {"cell": cell.cell, "pairs": pairs, "seed": seed, **comparison.collect_figures()}


class _MethodComparison:
    """Durations, planning times and peaks of every method over the pairs so far."""

    def __init__(self, cell: CellConfig, world: World, planner: Planner, seed: int) -> None:
        self._cell = cell
        self._world = world
        self._planner = planner
        self._scenes = SceneGenerator(cell, planner, world, seed)
        self._home = np.radians(cell.arm.poses_deg["home"])
        self._q = planner.plan(self._home, self._scenes.draw().drop).end
        self._durations: dict[str, list[float]] = defaultdict(list)
        self._planning_times_ms: dict[str, list[float]] = defaultdict(list)
        self._peaks: dict[str, Array] = defaultdict(lambda: np.zeros(3))
        self._failures: list[str] = []

    def plan_pair(self) -> None:
        """Draw one more pair and compute its motions by every method."""
        self._world.set_joint_positions(self._home)
        scene, start = self._scenes.draw(), self._q
        try:
            duration, motions = self._plan(start, scene)
        except (Blocked, Unreachable) as error:
            self._failures.append(str(error))
            return
        self._add("ours", duration, [motion.samples for motion in motions])
        self._compare(start, scene)

    def _add(self, method: str, duration: float, states: Sequence[JointState]) -> None:
        """Add the time [s] and the states of a pair."""
        shares = [compute_peak_fractions(one, self._planner.limits).max(axis=1) for one in states]
        self._durations[method].append(duration)
        self._peaks[method] = np.max([self._peaks[method], *shares], axis=0)

    def collect_figures(self) -> Figures:
        """Return the table of all methods, and the problems.

        Raises:
            InputError: No pair could be planned.
        """
        if "ours" not in self._durations:
            raise InputError(f"no motion was found in cell {self._cell.cell}: {self._failures[0]}")
        rows = {name: self._make_row(name) for name in self._durations}
        lower_bound = rows["lower bound"]["time_s"]
        over_limit = [name for name in PEAKS if rows["ours"][name] > 1 + PEAK_TOLERANCE]
        return {
            "planned_pairs": len(self._durations["ours"]),
            "methods": [
                {"method": name, **row, "ratio_to_lower_bound": row["time_s"] / lower_bound}
                for name, row in rows.items()
            ],
            "problems": [
                *(f"{name} over its limit" for name in over_limit),
                *(f"not planned: {failure}" for failure in self._failures),
            ],
        }

    def _make_row(self, method: str) -> Figures:
        """Return mean duration [s], peaks relative to the limits, and planning times [ms] of a method."""
        peaks = zip(PEAKS, self._peaks[method].tolist(), strict=True)
        planning = self._planning_times_ms[method]
        median, p99 = np.percentile(planning, (50, 99)).tolist() if planning else (None, None)
        row = {"time_s": float(np.mean(self._durations[method])), **dict(peaks)}
        return {**row, "planning_median_ms": median, "planning_p99_ms": p99}

    def _plan(self, start: Array, scene: Scene) -> tuple[float, tuple[Trajectory, Trajectory]]:
        """Plan both motions of a pair, keep the end posture as the next start, and return their duration [s].

        On contact the arm brakes along the approach; the transit begins where the arm comes to rest.
        """
        planner = self._planner
        approach = self._call_timed("ours", planner.plan, start, scene.approach, scene.fetch_task)
        tips, _ = planner.kinematics.compute_tcps_and_axes(approach.samples.q)
        above = int(np.flatnonzero(tips[:, 2] > scene.contact_height)[-1])
        touched = min((above + 1) * STEP, approach.duration)
        stop = plan_braking(approach, touched, planner.limits)
        grasp = approach.state_at(float(stop[-1])).q
        transit = self._call_timed(
            "ours", planner.plan, grasp, scene.drop, scene.make_carry_task(scene.breakaway_force)
        )
        self._q = transit.end
        return touched + len(stop) * STEP + transit.duration, (approach, transit)

    def _call_timed(self, method: str, plan: Callable[..., T], *args: Any) -> T:
        """Return the result of `plan`, and record its planning time."""
        began = time.perf_counter()
        try:
            return plan(*args)
        finally:
            self._planning_times_ms[method].append((time.perf_counter() - began) * 1e3)

    def _compare(self, start: Array, scene: Scene) -> None:
        """Compute the motions of the other methods between the same positions."""
        kinematics, limits = self._planner.kinematics, self._planner.limits
        height = compute_travel_height(self._cell)
        waypoints = baselines.find_waypoints(kinematics, limits, start, scene.touch, scene.drop, height)
        if "lower bound" not in self._durations:
            baselines.plan_with_toppra(waypoints[0], limits)  # The first call compiles; do not time it.
        followers = {"stops at waypoints": baselines.plan_with_stops, "TOPP-RA": baselines.plan_with_toppra}
        for name, follow in followers.items():
            motions = [self._call_timed(name, follow, path, limits) for path in waypoints]
            self._add(name, sum(duration for duration, _ in motions), [states for _, states in motions])
        motion = baselines.find_lower_bound(kinematics, limits, start, scene.touch, scene.drop)
        self._add("lower bound", *motion)


if __name__ == "__main__":
    run_command(
        measure,
        *CELL_OPTIONS,
        click.option(
            "--pairs", type=click.IntRange(min=1), default=200, show_default=True, help="Random pairs."
        ),
        click.option("--execute", is_flag=True, help="Have the simulated arm make the motions instead."),
    )
