"""The planner's motions as the simulated arm really makes them, step by step, with the object in its tool."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from executive.arm import Goal, Task
from executive.campaign.motion_gauge import Gauge
from executive.campaign.motion_scenes import Scene, Scenes
from executive.campaign.motion_trial import EVERY, Progress, opened, repeat, silent
from executive.cell_config import CellConfig
from executive.clock import STEP
from executive.errors import Blocked, Unreachable
from executive.geometry import Pose
from executive.motion.planner import Planner
from executive.sim.arm import SimArm
from executive.sim.clock import SimClock
from executive.sim.tool import SuctionTool
from executive.sim.world import World
from executive.view.figures.motion import ExecutionFigures

SETTLE = 24
"""Steps given to a seal, as the skill that grasps does."""


def execute(config: CellConfig, pairs: int, seed: int, progress: Progress = silent) -> ExecutionFigures:
    """Return what was seen while the arm made the motions of `pairs` random pairs, which a seed decides.

    An object is removed where it was let go, so the bins stay empty.

    Raises:
        InputError: The cell has no pairs to move between.
        Unreachable, Blocked: The arm finds no way to where it begins.
        Fault: The arm left its path.
    """
    with opened(config) as (world, planner):
        run = _Run(config, world, planner, seed)
        repeat(run.pair, pairs, progress)
        return run.figures(pairs)


class _Run:
    """An arm and its tool in a live world, and what was seen so far."""

    def __init__(self, config: CellConfig, world: World, planner: Planner, seed: int) -> None:
        self._world = world
        self._tool = SuctionTool(world, config.tool)
        self._arm = SimArm(world, planner, config, SimClock(world, STEP), lambda: self._tool.held_body)
        self._scenes = Scenes(config, planner, world, seed)
        self._gauge = Gauge(world, config.motion.margin)
        self._slip = self._tracking = 0.0
        self._missed = self._drops = 0
        self._times: list[int] = []
        self._failures: list[str] = []
        self._move(self._scenes.resting_place(), Task())

    def pair(self) -> None:
        """Fetch one more object and carry it into a bin."""
        scene = self._scenes.next()
        try:
            self._fetch_and_carry(scene)
        except (Blocked, Unreachable) as error:
            self._failures.append(str(error))
        self._tool.open()

    def figures(self, pairs: int) -> ExecutionFigures:
        """Return what was seen."""
        nearest = self._gauge.least
        return ExecutionFigures(
            pairs=pairs,
            clearance=nearest.distance if math.isfinite(nearest.distance) else None,
            nearest=nearest.what,
            contacts=tuple(sorted(self._gauge.contacts)),
            slip=self._slip,
            missed=self._missed,
            drops=self._drops,
            tracking=self._tracking,
            time=float(np.mean(self._times)) * STEP if self._times else None,
            failures=tuple(self._failures),
        )

    def _fetch_and_carry(self, scene: Scene) -> None:
        fetching = self._move(scene.approach, scene.fetching, scene, until=lambda: self._tool.touching)
        self._tool.close()
        for _ in range(SETTLE):
            self._step()
        if self._empty():
            self._missed += 1
            return
        carrying = self._move(scene.drop, scene.carrying(self._tool.bears), scene, until=self._empty)
        if self._empty():
            self._drops += 1
        else:
            self._times.append(fetching + carrying)

    def _empty(self) -> bool:
        return not self._tool.holding

    def _move(
        self, goal: Goal, task: Task, scene: Scene | None = None, until: Callable[[], bool] = lambda: False
    ) -> int:
        """Make a motion, braking as soon as `until` holds, and return how many steps it took.

        Raises:
            Unreachable, Blocked: There is none.
            Fault: The arm left its path.
        """
        arm = self._arm
        motion = arm.plan(goal, task).result()
        grasp, steps, braking = self._in_tool(), 0, False
        if scene is not None:
            self._gauge.begin(scene, self._tool.held_body)
        arm.start(motion)
        while not arm.at_rest:
            if not braking and until():
                arm.stop()
                braking = True
            self._step()
            steps += 1
            braking = braking or arm.met is not None
            if not braking:
                error = np.abs(arm.q - motion.at(steps * STEP).q)
                self._tracking = max(self._tracking, float(error.max()))
            if scene is not None:
                self._look(scene, steps, grasp)
        if arm.met is not None:
            self._gauge.contacts.add(arm.met)
        return steps

    def _look(self, scene: Scene, steps: int, grasp: Pose | None) -> None:
        held = self._tool.held_body
        self._gauge.feel(scene, held)
        if steps % EVERY:
            return
        self._gauge.measure(scene, held)
        now = self._in_tool()
        if grasp is not None and now is not None:
            self._slip = max(self._slip, float(np.linalg.norm(now.position - grasp.position)))

    def _in_tool(self) -> Pose | None:
        """Return the pose of what is held in the tool's frame, or None."""
        held, world = self._tool.held_body, self._world
        return None if held is None else world.tool_pose().inverse() @ world.object_pose(held)

    def _step(self) -> None:
        self._arm.advance()
        self._world.step()
        self._tool.advance()
