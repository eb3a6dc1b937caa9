"""Random scenes of the benchmark of motion, and the motions of the planner as the simulated arm makes them.

A scene has objects on the table, one to pick, and a slot in a bin.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from executive.cell.arm import Goal, Task
from executive.cell.clock import STEP, StepClock
from executive.cell.config import CellConfig
from executive.cell.layout import build_bin
from executive.cell.objects import Load, ObjectClass, Obstacle
from executive.cells.sim.arm import SimArm
from executive.cells.sim.collision import ClearanceChecker
from executive.cells.sim.models import build_simulated_class, load_mesh
from executive.cells.sim.spawn import spawn_objects
from executive.cells.sim.tool import TOUCH_DISTANCE, SuctionTool, compute_breakaway_force, measure_contact
from executive.cells.sim.world import World, name_load
from executive.errors import Blocked, InputError, Unreachable
from executive.geometry import Pose, make_tool_down_pose
from executive.manipulation.tool_goals import make_object_goal, make_slot_goal
from executive.motion.arms import build_planner
from executive.motion.planner import Planner
from tests.benchmarks.report import Figures, show_progress

MAX_TRIES = 50
"""Maximum number of scenes drawn to find one whose object can be held and reached."""


@contextmanager
def open_world(cell: CellConfig) -> Iterator[tuple[World, Planner]]:
    """Yield a world without objects, and a planner that makes all checks of the planner of a run."""
    world, clearance = World(cell, visuals=False), ClearanceChecker(cell)
    try:
        yield world, build_planner(cell, clearance.check)
    finally:
        clearance.close()
        world.close()


@dataclass(frozen=True, eq=False)
class Scene:
    """Objects on the table, one of them to pick, and a slot in a bin.

    Attributes:
        body: Body of the object to pick.
        kind: Object class of `body`.
        contact_height: Height of the tool centre point at which contact with the object is detected [m].
        breakaway_force: Breakaway force of a seal on the object [N].
        target: The object to pick, at its true position.
        others: The other objects on the table, at their true positions.
        approach: Goal of the motion onto the object, equal to that of `tool_goals.approach`.
        drop: Goal of the motion into the bin, equal to that of `tool_goals.into` for an empty bin.
    """

    body: int
    kind: ObjectClass
    contact_height: float
    breakaway_force: float
    target: Obstacle
    others: tuple[Obstacle, ...]
    approach: Goal
    drop: Goal

    @property
    def touch(self) -> Goal:
        """Goal at which contact with the object is detected, without a guarded descent."""
        return Goal((*self.approach.position[:2], self.contact_height))

    @property
    def fetch_task(self) -> Task:
        """Task of the motion onto the object."""
        return Task(obstacles=self.others, target=self.target)

    def make_carry_task(self, breakaway_force: float) -> Task:
        """Return the task of the motion into the bin with a seal of this breakaway force [N]."""
        return Task(Load(self.kind, breakaway_force), self.others)


class SceneGenerator:
    """Generates random scenes and places their objects in a simulated world.

    The objects are those with which a run of the cell could begin; the first one is picked. The bins are
    empty. A scene is not used if no cup can hold its object in the middle, or a goal is out of reach.

    Args:
        cell: The cell file.
        planner: Planner of the arm; it tells which goals can be reached.
        world: World in which the objects are placed; the arm must keep out of their way.
        seed: Decides everything random.
    """

    def __init__(self, cell: CellConfig, planner: Planner, world: World, seed: int) -> None:
        self._cell = cell
        self._planner = planner
        self._world = world
        self._random = np.random.default_rng(seed)
        self._bins = [build_bin(name, bin) for name, bin in cell.bins.items()]
        self._tallest = max(kind.height for kind in cell.objects.values())

    def draw(self) -> Scene:
        """Replace the objects of the last scene by those of a new one.

        Raises:
            InputError: None of `MAX_TRIES` scenes could be used.
        """
        for _ in range(MAX_TRIES):
            for body in tuple(self._world.labels):
                self._world.remove_object(body)
            bodies = spawn_objects(self._world, int(self._random.integers(2**31)))
            if not bodies:
                continue
            try:
                scene = self._make_scene(bodies)
                self._planner.require_reachable(scene.approach)
                self._planner.require_reachable(scene.drop)
            except Unreachable:
                continue
            return scene
        raise InputError(
            f"none of {MAX_TRIES} scenes of cell {self._cell.cell} has an object to pick and place"
        )

    def _make_scene(self, bodies: tuple[int, ...]) -> Scene:
        bin = self._bins[int(self._random.integers(len(self._bins)))]
        slot = int(self._random.integers(len(bin.slots)))
        first, motion = bodies[0], self._cell.motion
        kind = self._kind(first)
        target, *others = (self._make_obstacle(body, number) for number, body in enumerate(bodies, start=1))
        centre = np.array([target.x, target.y, target.top - kind.height / 2])
        approach = make_object_goal(
            kind, centre, motion.descent, motion.descent_speed, slow_descent=motion.slow_descent
        )
        surface, force = self._measure_seal(first, approach.position[:2], target.top)
        drop = make_slot_goal(bin, slot, kind.height, self._tallest)
        return Scene(first, kind, surface + TOUCH_DISTANCE, force, target, tuple(others), approach, drop)

    def _make_obstacle(self, body: int, number: int) -> Obstacle:
        """Return an object as an obstacle at the centre of the bounding box of its outline from above."""
        kind = self._kind(body)
        mesh = load_mesh(self._cell.objects[kind.label])
        corners = self._world.get_object_pose(body).apply(mesh.vertices)
        low, high = corners.min(axis=0), corners.max(axis=0)
        x, y = ((low[:2] + high[:2]) / 2).tolist()
        # A run localizes each object on the table; the visual mesh of a duck begins 1 mm above the table.
        bottom = float(low[2]) if low[2] > kind.height / 2 else 0.0
        return Obstacle(x, y, kind.radius, bottom + kind.height, f"{kind.label}-{number}")

    def _kind(self, body: int) -> ObjectClass:
        label = self._world.labels[body]
        return build_simulated_class(label, self._cell.objects[label])

    def _measure_seal(self, body: int, place: tuple[float, float], top: float) -> tuple[float, float]:
        """Return the surface height under a cup at `place` [m], and the breakaway force of a seal there [N].

        Raises:
            Unreachable: No seal forms there.
        """
        tool = self._cell.tool
        surface, force = top + tool.reach, 0.0
        # Twice: the distance found by the rays depends a little on where they start.
        for _ in range(2):
            X_WT = make_tool_down_pose((*place, surface))
            seal = measure_contact(self._world.client, X_WT, {body}, tool.cup_radius, tool.reach)
            force = compute_breakaway_force(seal, tool)
            surface -= seal.distance if seal else 0.0
        if force < tool.min_force:
            raise Unreachable(f"no seal holds the {self._world.labels[body]} at its middle")
        return surface, force


MAX_MEASURED_DISTANCE = 0.03
"""Largest distance that is measured [m]."""
CLEARANCE_PERIOD_STEPS = 4
"""Control steps between two measurements of the distances."""
SETTLE_STEPS = 24
"""Steps in which a seal forms, as in the skill that grasps."""


def execute_pairs(cell: CellConfig, pairs: int, seed: int) -> Figures:
    """Execute random pairs in the simulated world and return their figures; a released object is removed."""
    with open_world(cell) as (world, planner):
        execution = _Execution(cell, world, planner)
        scenes = SceneGenerator(cell, planner, world, seed)
        for _ in show_progress(range(pairs), "executed"):
            execution.execute_pair(scenes.draw())
    distance, nearest = execution.clearance
    return {
        "executed_pairs": len(execution.steps_per_pair),
        "executed_time_s": float(np.mean(execution.steps_per_pair or [math.nan])) * STEP,
        "margin_mm": 1e3 * cell.motion.margin,
        "clearance_mm": 1e3 * distance,
        "nearest": nearest,
        "slip_mm": 1e3 * execution.slip,
        "missed": execution.missed_count,
        "problems": execution.problems,
    }


class _Execution:
    """An arm and its tool in a simulated world, and the figures so far.

    Two things that were nearer than the margin when a motion began (two objects side by side, one of them
    now in the tool, or the load and the table) do not count in that motion.

    Attributes:
        clearance: Smallest distance of the arm and its load in all measurements [m], and the two things.
        slip: Largest motion of a held object in the tool [m].
        missed_count: Number of objects that the tool did not hold.
        steps_per_pair: Number of control steps of each pair.
        problems: Motions without a plan, collisions and dropped objects.
    """

    def __init__(self, cell: CellConfig, world: World, planner: Planner) -> None:
        clock = StepClock(lambda: world.step_count * STEP)
        self._world = world
        self._tool = SuctionTool(world, cell.tool)
        self._arm = SimArm(world, planner, cell, clock, lambda: self._tool.held_body)
        self._margin = cell.motion.margin
        self.clearance = (math.inf, "nothing")
        self.slip = 0.0
        self.missed_count = 0
        self.steps_per_pair: list[int] = []
        self.problems: list[str] = []

    def execute_pair(self, scene: Scene) -> None:
        """Fetch one more object and carry it into a bin."""
        try:
            self._fetch_and_carry(scene)
        except (Blocked, Unreachable) as error:
            self.problems.append(f"not planned: {error}")
        self._tool.open()

    def _fetch_and_carry(self, scene: Scene) -> None:
        tool = self._tool
        fetching = self._move(scene.approach, scene.fetch_task, scene, lambda: tool.touching)
        tool.close()
        for _ in range(SETTLE_STEPS):
            self._step()
        if not tool.holding:
            self.missed_count += 1
            # The arm leaves the table, because the next scene may have an object where the tool is now.
            self._move(scene.drop, scene.fetch_task, scene, lambda: False)
            return
        task = scene.make_carry_task(tool.holding_force)
        carrying = self._move(scene.drop, task, scene, lambda: not tool.holding)
        if tool.holding:
            self.steps_per_pair.append(fetching + carrying)
        else:
            self.problems.append("an object was dropped")

    def _move(self, goal: Goal, task: Task, scene: Scene, until: Callable[[], bool]) -> int:
        """Make a motion, braking as soon as `until` holds, and return the number of its steps.

        Raises:
            Unreachable, Blocked: There is no motion.
            Fault: The arm left its path.
        """
        arm = self._arm
        motion = arm.plan(goal, task).result()
        grasp = self._locate_in_tool()
        steps = 0
        is_braking = False
        ignored = {pair for distance, pair in self._measure_distances(scene.body) if distance < self._margin}
        arm.start(motion)
        while not arm.at_rest:
            if not is_braking and until():
                arm.stop()
                is_braking = True
            self._step()
            steps += 1
            if steps % CLEARANCE_PERIOD_STEPS == 0:
                distances = self._measure_distances(scene.body)
                self.clearance = min(self.clearance, *(one for one in distances if one[1] not in ignored))
                now = self._locate_in_tool()
                if grasp is not None and now is not None:
                    self.slip = max(self.slip, float(np.linalg.norm(now.position - grasp.position)))
        if arm.collision is not None:
            self.problems.append(f"contact: {arm.collision}")
        return steps

    def _measure_distances(self, target_body: int) -> Iterator[tuple[float, str]]:
        """Yield the distance [m] and the names of two near things; contact with the target is allowed."""
        world = self._world
        near = world.client.getClosestPoints
        held = self._tool.held_body
        load = "" if held is None else name_load(world.labels[held])
        for body in (world.table, *world.bin_bodies.values(), *world.labels):
            if body in (held, target_body):
                continue
            for point in near(world.arm, body, MAX_MEASURED_DISTANCE):
                if point[3] >= world.robot.first_collision_link:
                    yield point[8], f"{world.name_link(point[3])} - {world.name_body(body)}"
            for point in near(held, body, MAX_MEASURED_DISTANCE) if load else ():
                yield point[8], f"{load} - {world.name_body(body)}"
        for one, other in world.robot.self_collision_pairs:
            for point in near(world.arm, world.arm, MAX_MEASURED_DISTANCE, linkIndexA=one, linkIndexB=other):
                yield point[8], f"{world.name_link(one)} - {world.name_link(other)}"
        for point in near(held, world.arm, MAX_MEASURED_DISTANCE) if load else ():
            if world.robot.first_collision_link <= point[4] < world.robot.wrist_link:
                yield point[8], f"{load} - {world.name_link(point[4])}"

    def _locate_in_tool(self) -> Pose | None:
        """Return the pose of the held object in the tool's frame, or None."""
        held = self._tool.held_body
        world = self._world
        return None if held is None else world.get_tool_pose().inverse() @ world.get_object_pose(held)

    def _step(self) -> None:
        self._arm.advance()
        self._world.step()
        self._tool.advance()
