"""Motions of the planner compared with other ways to move between the same random places.

The arm goes from bin to object to bin, each pair from the end of the pair before. Every method begins a pair
in the posture in which the planner's own motion left the arm. Nothing moves by physics here: the positions of
the objects are known exactly, and a motion is taken to go as planned. With `--execute` the simulated arm
makes the planner's motions, too (`motion_execution.py`).
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import click
import numpy as np

from executive.cell_config import CellConfig
from executive.clock import STEP
from executive.errors import Blocked, InputError, Unreachable
from executive.geometry import Array
from executive.layout import travel_height
from executive.motion.planner import Planner
from executive.motion.state import State
from executive.motion.stop import brake
from executive.motion.trajectory import Trajectory, peaks
from executive.sim.world import World
from tests.benchmarks import motion_rivals as rivals
from tests.benchmarks.motion_execution import execute_pairs
from tests.benchmarks.motion_scenes import Scene, Scenes, open_world
from tests.benchmarks.report import CELL_OPTIONS, Figures, run_command, show_progress

T = TypeVar("T")
PEAKS = ("velocity", "acceleration", "jerk")
"""Largest velocity, acceleration and jerk of a joint, each over its limit."""
PEAK_TOLERANCE = 1e-6
"""Rounding of peaks over their limits."""


def measure(cell: CellConfig, seed: int = 0, pairs: int = 200, execute: bool = False) -> Figures:
    """Measure the motions of the arm of CELL from bin to object to bin, and other ways to move."""
    if execute:
        return {"cell": cell.cell, "pairs": pairs, "seed": seed, **execute_pairs(cell, pairs, seed)}
    with open_world(cell) as (world, planner):
        trial = _Trial(cell, world, planner, seed)
        for _ in show_progress(range(pairs), "planned"):
            trial.plan_pair()
        return {"cell": cell.cell, "pairs": pairs, "seed": seed, **trial.collect_figures()}


class _Trial:
    """The pairs so far."""

    def __init__(self, cell: CellConfig, world: World, planner: Planner, seed: int) -> None:
        self._cell = cell
        self._world = world
        self._planner = planner
        self._scenes = Scenes(cell, planner, world, seed)
        self._home = np.radians(cell.arm.poses_deg["home"])
        self._q = planner.plan(self._home, self._scenes.draw().drop).end
        self._times: dict[str, list[float]] = defaultdict(list)
        self._planning: dict[str, list[float]] = defaultdict(list)
        self._peaks: dict[str, Array] = defaultdict(lambda: np.zeros(3))
        self._failures: list[str] = []

    def plan_pair(self) -> None:
        """Move to one more random object and into a bin, by every method."""
        self._world.set_arm(self._home)
        scene, start = self._scenes.draw(), self._q
        try:
            duration, motions = self._plan(start, scene)
        except (Blocked, Unreachable) as error:
            self._failures.append(str(error))
            return
        self._add("ours", duration, [motion.samples for motion in motions])
        self._compare(start, scene)

    def _add(self, method: str, duration: float, states: Sequence[State]) -> None:
        """Add the time [s] and the states of a pair."""
        shares = [peaks(one, self._planner.limits).max(axis=1) for one in states]
        self._times[method].append(duration)
        self._peaks[method] = np.max([self._peaks[method], *shares], axis=0)

    def collect_figures(self) -> Figures:
        """Return the table of all methods, and the problems.

        Raises:
            InputError: No pair could be moved between.
        """
        if "ours" not in self._times:
            raise InputError(f"no motion was found in cell {self._cell.cell}: {self._failures[0]}")
        rows = {name: self._make_row(name) for name in self._times}
        floor = rows["floor"]["time_s"]
        over_limit = [name for name in PEAKS if rows["ours"][name] > 1 + PEAK_TOLERANCE]
        return {
            "planned_pairs": len(self._times["ours"]),
            "methods": [
                {"method": name, **row, "over_floor": row["time_s"] / floor} for name, row in rows.items()
            ],
            "problems": [
                *(f"{name} over its limit" for name in over_limit),
                *(f"not planned: {failure}" for failure in self._failures),
            ],
        }

    def _make_row(self, method: str) -> Figures:
        """Return mean time [s], peaks over the limits and planning times [ms] of a method."""
        peaks = zip(PEAKS, self._peaks[method].tolist(), strict=True)
        planning = self._planning[method]
        median, p99 = np.percentile(planning, (50, 99)).tolist() if planning else (None, None)
        row = {"time_s": float(np.mean(self._times[method])), **dict(peaks)}
        return {**row, "planning_median_ms": median, "planning_p99_ms": p99}

    def _plan(self, start: Array, scene: Scene) -> tuple[float, tuple[Trajectory, Trajectory]]:
        """Return the time of the planner's ride [s] and its motions; the arm then stands at its end.

        The approach ends at the end of the stop that the touch causes, and there the transit begins.
        """
        planner = self._planner
        approach = self._time("ours", planner.plan, start, scene.approach, scene.fetching)
        tips, _ = planner.kinematics.tips(approach.samples.q)
        above = int(np.flatnonzero(tips[:, 2] > scene.surface)[-1])
        touched = min((above + 1) * STEP, approach.duration)
        stop = brake(approach, touched, planner.limits, STEP)
        grasp = approach.at(float(stop[-1])).q
        transit = self._time("ours", planner.plan, grasp, scene.drop, scene.carrying(scene.bears))
        self._q = transit.end
        return touched + len(stop) * STEP + transit.duration, (approach, transit)

    def _time(self, method: str, plan: Callable[..., T], *args: Any) -> T:
        """Call `plan` and note the time that it takes."""
        began = time.perf_counter()
        try:
            return plan(*args)
        finally:
            self._planning[method].append((time.perf_counter() - began) * 1e3)

    def _compare(self, start: Array, scene: Scene) -> None:
        """Move between the same places by the other methods."""
        kinematics, limits = self._planner.kinematics, self._planner.limits
        height = travel_height(self._cell)
        chains = rivals.find_chains(kinematics, limits, start, scene.touch, scene.drop, height)
        if "floor" not in self._times:
            rivals.follow_with_toppra(chains[0], limits)  # The first call compiles; do not time it.
        followers = {"stops at corners": rivals.stop_at_corners, "TOPP-RA": rivals.follow_with_toppra}
        for name, follow in followers.items():
            motions = [self._time(name, follow, chain, limits) for chain in chains]
            self._add(name, sum(duration for duration, _ in motions), [states for _, states in motions])
        ride = rivals.find_floor(kinematics, limits, start, scene.touch, scene.drop)
        self._add("floor", *ride)


if __name__ == "__main__":
    run_command(
        measure,
        *CELL_OPTIONS,
        click.option(
            "--pairs", type=click.IntRange(min=1), default=200, show_default=True, help="Random pairs."
        ),
        click.option("--execute", is_flag=True, help="Have the simulated arm make the motions instead."),
    )
