"""Random scenes of the benchmark of motion: objects on the table, one to pick, and a place in a bin."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from executive.arm import Goal, Task
from executive.cell_config import CellConfig
from executive.errors import InputError, Unreachable
from executive.geometry import tool_down
from executive.goals import onto, over
from executive.layout import as_bin
from executive.messages import Load, ObjectClass, Obstacle
from executive.motion.planner import Planner
from executive.sim.clearance import PathClearance
from executive.sim.models import load_mesh, weighed
from executive.sim.seal import breakaway, measure
from executive.sim.spawn import spawn
from executive.sim.tool import TOUCH
from executive.sim.world import World

MAX_TRIES = 50
"""Scenes drawn until one has an object that can be held and reached."""


@contextmanager
def open_world(cell: CellConfig) -> Iterator[tuple[World, Planner]]:
    """Yield a world without objects, and the planner of a run with all of its checks."""
    world, clearance = World(cell, visuals=False), PathClearance(cell)
    try:
        yield world, Planner(cell, clearance.check)
    finally:
        clearance.close()
        world.close()


@dataclass(frozen=True, eq=False)
class Scene:
    """One pair of places: where to pick and where to drop.

    Attributes:
        body: Body of the object to pick.
        kind: Its class.
        surface: Height of the tool centre point at which the cup feels it [m].
        bears: Pull that a seal there bears [N].
        target: The object to pick, where it really is.
        others: The other objects on the table, where they really are.
        approach: Goal of the motion onto it, as `executive.goals.approach` makes it.
        drop: Goal of the motion into the bin, as `executive.goals.into` makes it for an empty bin.
    """

    body: int
    kind: ObjectClass
    surface: float
    bears: float
    target: Obstacle
    others: tuple[Obstacle, ...]
    approach: Goal
    drop: Goal

    @property
    def touch(self) -> Goal:
        """The tool where it feels the object, without a guarded descent."""
        return Goal((*self.approach.position[:2], self.surface))

    @property
    def fetching(self) -> Task:
        """Task of the motion onto the object."""
        return Task(around=self.others, target=self.target)

    def carrying(self, bears: float) -> Task:
        """Return the task of the motion into the bin with a seal that bears so much [N]."""
        return Task(Load(self.kind, bears), self.others)


class Scenes:
    """Draws one scene after another into a live world.

    The objects are those with which a run of the cell could begin; the first one is picked. The bins are
    empty. A scene is not used if no cup can hold its object in the middle, or a goal is out of reach.

    Args:
        cell: The cell file.
        planner: Knows the reach of the arm.
        world: Where the objects are put; the arm must keep out of their way.
        seed: Decides everything random.
    """

    def __init__(self, cell: CellConfig, planner: Planner, world: World, seed: int) -> None:
        self._cell = cell
        self._planner = planner
        self._world = world
        self._random = np.random.default_rng(seed)
        self._bins = [as_bin(name, bin) for name, bin in cell.bins.items()]
        self._tallest = max(kind.height for kind in cell.objects.values())

    def draw(self) -> Scene:
        """Replace the objects of the last scene by those of a new one.

        Raises:
            InputError: None of `MAX_TRIES` scenes could be used.
        """
        for _ in range(MAX_TRIES):
            for body in tuple(self._world.bodies):
                self._world.remove_object(body)
            bodies = spawn(self._world, self._cell, int(self._random.integers(2**31)))
            if not bodies:
                continue
            try:
                scene = self._describe(bodies)
                self._planner.require_reachable(scene.approach)
                self._planner.require_reachable(scene.drop)
            except Unreachable:
                continue
            return scene
        raise InputError(
            f"none of {MAX_TRIES} random scenes of cell {self._cell.cell} has an object that can be picked "
            "and placed; move its bins or its table nearer to the arm"
        )

    def _describe(self, bodies: tuple[int, ...]) -> Scene:
        bin = self._bins[int(self._random.integers(len(self._bins)))]
        slot = int(self._random.integers(len(bin.slots)))
        first, motion = bodies[0], self._cell.motion
        kind = self._kind(first)
        target, *others = (self._obstacle(body, number) for number, body in enumerate(bodies, start=1))
        centre = np.array([target.x, target.y, target.top - kind.height / 2])
        approach = onto(kind, centre, motion.descent, motion.descent_speed)
        surface, bears = self._measure_seal(first, approach.position[:2], target.top)
        drop = over(bin, slot, kind.height, self._tallest)
        return Scene(first, kind, surface + TOUCH, bears, target, tuple(others), approach, drop)

    def _obstacle(self, body: int, number: int) -> Obstacle:
        """Return an object as it stands, at the middle of its outline seen from above."""
        kind = self._kind(body)
        mesh = load_mesh(self._cell.objects[kind.label])
        corners = self._world.object_pose(body).apply(mesh.vertices)
        low, high = corners.min(axis=0), corners.max(axis=0)
        x, y = ((low[:2] + high[:2]) / 2).tolist()
        return Obstacle(x, y, kind.radius, float(low[2]) + kind.height, f"{kind.label}-{number}")

    def _kind(self, body: int) -> ObjectClass:
        label = self._world.bodies[body]
        return weighed(label, self._cell.objects[label])

    def _measure_seal(self, body: int, place: tuple[float, float], top: float) -> tuple[float, float]:
        """Return the height of the object under a cup at `place` [m], and the pull a seal bears there [N].

        Raises:
            Unreachable: No seal forms there.
        """
        tool = self._cell.tool
        surface, bears = top + tool.reach, 0.0
        # Twice: the distance found by the rays depends a little on where they start.
        for _ in range(2):
            X_WT = tool_down((*place, surface))
            seal = measure(self._world.client, X_WT, {body}, tool.cup_radius, tool.reach)
            bears = breakaway(seal, tool)
            surface -= seal.distance if seal else 0.0
        if bears < tool.least_force:
            raise Unreachable(f"no seal holds the {self._world.bodies[body]} at its middle")
        return surface, bears
