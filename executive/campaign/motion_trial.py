"""The planner's motions beside others between the same random places, in one run on one machine.

The arm goes from bin to object to bin, pair after pair, each from where the one before ended. Every method
begins a pair in the posture in which the planner's own motion left the arm. Nothing moves by physics here:
where objects are is known exactly, distances are measured with the arm put along its way, and a motion is
taken to go as planned. What the simulated arm makes of it is for `executive.campaign.motion_execution`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from executive.campaign.motion_article import CYCLE, MOTION, article_peaks
from executive.campaign.motion_gauge import Gauge
from executive.campaign.motion_rivals import Textbook, floor, textbook, toppra
from executive.campaign.motion_scenes import Scene, Scenes
from executive.cell_config import CellConfig
from executive.clock import STEP
from executive.errors import Blocked, InputError, Unreachable
from executive.geometry import Array
from executive.layout import travel_height
from executive.motion.limits import JointLimits
from executive.motion.planner import Planner
from executive.motion.state import State
from executive.motion.stop import brake
from executive.motion.trajectory import Trajectory, peaks
from executive.sim.clearance import PathClearance
from executive.sim.world import World
from executive.view.figures.motion import MethodFigures, MotionFigures, PlanningFigures

Progress = Callable[[int, int], None]
"""Is told how many pairs of how many are done."""
EVERY = 4
"""Control steps between two looks at the distances."""


@contextmanager
def opened(config: CellConfig) -> Iterator[tuple[World, Planner]]:
    """Yield a world without objects and the planner as a run has it, its checks included."""
    world, clearance = World(config, visuals=False), PathClearance(config)
    try:
        yield world, Planner(config, clearance.check)
    finally:
        clearance.close()
        world.close()


def silent(done: int, total: int) -> None:
    """Tell nobody how far a measurement is."""
    del done, total


def repeat(pair: Callable[[], None], pairs: int, progress: Progress) -> None:
    """Go through so many pairs, telling after each how far it is."""
    for number in range(pairs):
        pair()
        progress(number + 1, pairs)


def measure(config: CellConfig, pairs: int, seed: int, progress: Progress = silent) -> MotionFigures:
    """Return the figures of `pairs` random pairs.

    Raises:
        InputError: The cell has no pairs to move between, or the planner found no motion for any.
    """
    with opened(config) as (world, planner):
        trial = _Trial(config, world, planner, seed)
        repeat(trial.pair, pairs, progress)
        return trial.figures(seed)


@dataclass
class _Tally:
    """Figures of one method, pair by pair."""

    limits: JointLimits
    times: list[float] = field(default_factory=list)
    planning: list[float] = field(default_factory=list)
    peaks: Array = field(default_factory=lambda: np.zeros(3))

    def add(self, duration: float, states: Sequence[State]) -> None:
        self.times.append(duration)
        self.peaks = np.max(
            [self.peaks, *(peaks(motion, self.limits).max(axis=1) for motion in states)], axis=0
        )

    def figures(self, name: str, clearance: float | None = None) -> MethodFigures:
        velocity, acceleration, jerk = (float(peak) for peak in self.peaks)
        planning = (
            (float(np.median(self.planning)), float(np.percentile(self.planning, 99)))
            if self.planning
            else None
        )
        return MethodFigures(
            name, float(np.mean(self.times)), (velocity, acceleration, jerk), planning, clearance
        )


class _Trial:
    """The pairs so far."""

    def __init__(self, config: CellConfig, world: World, planner: Planner, seed: int) -> None:
        self._config = config
        self._world = world
        self._planner = planner
        self._scenes = Scenes(config, planner, world, seed)
        self._gauge = Gauge(world, config.motion.margin)
        self._home = np.radians(config.arm.poses_deg["home"])
        self._q = planner.plan(self._home, self._scenes.resting_place()).end
        limits = planner.limits
        self._ours, self._stopping = _Tally(limits), _Tally(limits)
        self._toppra, self._floor = _Tally(limits), _Tally(limits)
        self._free_floor: list[float] = []
        self._failures: list[str] = []
        self._first: Textbook | None = None

    def pair(self) -> None:
        """Move to one more random object and into a bin, by every method."""
        self._world.set_arm(self._home)
        scene = self._scenes.next()
        start = self._q
        try:
            duration, motions = self._fly(start, scene)
        except (Blocked, Unreachable) as error:
            self._failures.append(str(error))
            return
        self._ours.add(duration, [motion.samples for motion in motions])
        self._rivals(start, scene)

    def figures(self, seed: int) -> MotionFigures:
        """Return what was measured.

        Raises:
            InputError: No pair could be moved between.
        """
        if self._first is None:
            raise InputError(
                f"no motion was found for any pair of cell {self._config.cell}: {self._failures[0]}"
            )
        velocity, acceleration, jerk = article_peaks(self._config, self._first, self._planner.limits)
        return MotionFigures(
            cell=self._config.cell,
            pairs=len(self._ours.times),
            seed=seed,
            margin=self._config.motion.margin,
            article=MethodFigures("article", MOTION, (float(velocity), float(acceleration), float(jerk))),
            article_cycle=CYCLE,
            stopping=self._stopping.figures("stops at vias"),
            toppra=self._toppra.figures("TOPP-RA"),
            floor=self._floor.figures("floor"),
            free_floor=float(np.mean(self._free_floor)),
            ours=self._ours.figures("ours", self._gauge.least.distance),
            nearest=self._gauge.least.what,
            planning=self._planning(),
        )

    def _planning(self) -> PlanningFigures:
        taken = np.array(self._ours.planning)
        return PlanningFigures(
            motions=len(taken),
            median=float(np.median(taken)),
            p99=float(np.percentile(taken, 99)),
            within_50=float(np.mean(taken <= 50)),
            within_150=float(np.mean(taken <= 150)),
            failures=tuple(self._failures),
        )

    def _fly(self, start: Array, scene: Scene) -> tuple[float, tuple[Trajectory, Trajectory]]:
        """Return the time of the planner's ride [s] and its motions; the arm then stands at its end.

        The approach ends where the stop ends that the touch causes, and there the transit begins.
        """
        planner = self._planner
        approach = self._timed(lambda: planner.plan(start, scene.approach, scene.fetching))
        tips, _ = planner.kinematics.tips(approach.samples.q)
        above = int(np.flatnonzero(tips[:, 2] > scene.surface)[-1])
        touched = min((above + 1) * STEP, approach.duration)
        stop = brake(approach, touched, planner.limits, STEP)
        grasp = approach.at(float(stop[-1])).q
        transit = self._timed(lambda: planner.plan(grasp, scene.drop, scene.carrying(scene.bears)))
        self._look(scene, approach, transit, float(stop[-1]))
        self._q = transit.end
        return touched + len(stop) * STEP + transit.duration, (approach, transit)

    def _timed(self, plan: Callable[[], Trajectory]) -> Trajectory:
        began = time.perf_counter()
        try:
            return plan()
        finally:
            self._ours.planning.append((time.perf_counter() - began) * 1e3)

    def _look(self, scene: Scene, approach: Trajectory, transit: Trajectory, end: float) -> None:
        """Measure the distances along both motions, the object in the tool on the second."""
        world, forward = self._world, self._planner.kinematics.forward
        world.set_arm(approach.start)
        self._gauge.begin(scene)
        for s in np.append(np.arange(0.0, end, EVERY * STEP), end):
            world.set_arm(approach.at(float(s)).q)
            self._gauge.measure(scene)
        self._gauge.begin(scene, held=scene.body)
        X_TO = forward(transit.start).inverse() @ world.object_pose(scene.body)
        for q in transit.samples.q[::EVERY]:
            world.set_arm(q)
            world.place_object(scene.body, forward(q) @ X_TO)
            self._gauge.measure(scene, held=scene.body)

    def _rivals(self, start: Array, scene: Scene) -> None:
        kinematics, limits = self._planner.kinematics, self._planner.limits
        way = textbook(kinematics, limits, start, scene.touch, scene.drop, travel_height(self._config))
        if self._first is None:
            self._first = way
            toppra(way.fetch, limits)  # The first call loads the package, which is no planning time.
        began = time.perf_counter()
        ride = way.stopping(limits)
        self._stopping.planning.append((time.perf_counter() - began) * 1e3 / len(ride.states))
        self._stopping.add(ride.time, ride.states)
        total, motions = 0.0, []
        for chain in (way.fetch, way.carry):
            began = time.perf_counter()
            duration, states = toppra(chain, limits)
            self._toppra.planning.append((time.perf_counter() - began) * 1e3)
            total += duration
            motions.append(states)
        self._toppra.add(total, motions)
        ride, free = floor(kinematics, limits, start, scene.touch, scene.drop)
        self._floor.add(ride.time, ride.states)
        self._free_floor.append(free)
