"""Random scenes of the benchmark of motion.

A scene has objects on the table, one to pick, and a slot in a bin.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from executive.cell.arm import Goal, Task
from executive.cell.config import CellConfig
from executive.cell.objects import ObjectClass, Obstacle, Target
from executive.cell.tools import GraspAttempt
from executive.drivers.sim.models import compute_mass, load_mesh
from executive.drivers.sim.spawn import spawn_objects
from executive.drivers.sim.world import World
from executive.errors import InputError, Unreachable
from executive.geometry import make_tool_down_pose
from executive.manipulation.tool_goals import make_slot_goal
from executive.motion.configurations import find_configuration_pairs
from executive.motion.planner import Planner
from executive.physics.collision import ClearanceChecker
from executive.tools.suction import compute_breakaway_force, measure_contact

MAX_TRIES = 50
"""Maximum number of scenes drawn to find one whose object can be held and reached."""


def replace_solver(cell: CellConfig, solver: str | None) -> CellConfig:
    """Return the cell with another solver of its arm; None: the solver of its arm file."""
    arm = cell.arm.model_copy(update={"solver": solver or cell.arm.solver})
    return cell.model_copy(update={"arm": arm})


@contextmanager
def open_world(cell: CellConfig) -> Iterator[tuple[World, Planner]]:
    """Yield a world without objects, and a planner that makes all checks of the planner of a run."""
    world = World(cell)
    clearance = ClearanceChecker(cell)
    try:
        yield world, Planner(cell, clearance.check)
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
        approach: Goal of the motion onto the object, equal to that of `tool_goals.choose_grasp`.
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
        return Task(self.kind, breakaway_force, self.others)


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
        self._bins = list(cell.build_bins().values())
        self._tallest = max(kind.height for kind in cell.objects.values())

    def draw(self) -> Scene:
        """Replace the objects of the last scene by those of a new one.

        Raises:
            InputError: None of `MAX_TRIES` scenes could be used.
        """
        q_seed = np.zeros(self._cell.arm.joint_count)
        for _ in range(MAX_TRIES):
            for body in tuple(self._world.labels):
                self._world.remove_object(body)
            bodies = spawn_objects(self._world, int(self._random.integers(2**31)))
            if not bodies:
                continue
            try:
                scene = self._make_scene(bodies)
                for goal in (scene.approach, scene.drop):
                    length = max(0.0, self._cell.travel_height - goal.position[2])
                    find_configuration_pairs(self._planner.kinematics, goal, length, q_seed)
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
        tool = self._cell.tool
        approach = tool.list_grasps(
            kind,
            Target("object-1", kind.label, centre, 1.0, 0, 0, 0.0),
            motion,
            GraspAttempt(is_confirmed=True),
        )[0].goal
        surface, force = self._measure_seal(first, approach.position[:2], target.top)
        drop = make_slot_goal(bin, slot, kind.height, self._tallest)
        return Scene(first, kind, surface + tool.touch_distance, force, target, tuple(others), approach, drop)

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
        section = self._cell.objects[label]
        return replace(section.build_class(label), mass=compute_mass(section))

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
