"""What the bench of motion moves between: random objects on the table, one to pick, and a place in a bin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from executive.arm import Goal, Task
from executive.cell_config import CellConfig
from executive.errors import InputError, Unreachable
from executive.geometry import tool_down
from executive.goals import onto, over
from executive.layout import as_bin
from executive.messages import Bin, Load, ObjectClass, Obstacle
from executive.motion.planner import Planner
from executive.sim.models import load_mesh, weighed
from executive.sim.seal import breakaway, measure
from executive.sim.spawn import spawn
from executive.sim.tool import TOUCH
from executive.sim.world import World

TRIES = 50
"""Scenes drawn until one has an object that can be held and reached."""


@dataclass(frozen=True, eq=False)
class Scene:
    """One pair: where to pick and where to place.

    Attributes:
        body: Body of the object to pick.
        kind: Its class.
        place: Where it is touched, seen from above [m].
        surface: Height of the tool centre point at which the cup feels it [m].
        bears: Pull that a seal there bears [N].
        target: The object to pick, where it really is.
        others: What else stands on the table, where it really is.
        approach: Goal of the motion onto it, as `executive.goals.approach` makes it.
        drop: Goal of the motion into the bin, as `executive.goals.into` makes it for an empty one.
    """

    body: int
    kind: ObjectClass
    place: tuple[float, float]
    surface: float
    bears: float
    target: Obstacle
    others: tuple[Obstacle, ...]
    approach: Goal
    drop: Goal

    @property
    def touch(self) -> Goal:
        """The tool where it feels the object, without a guarded descent."""
        return Goal((*self.place, self.surface))

    @property
    def fetching(self) -> Task:
        """What the motion onto the object has to heed."""
        return Task(around=self.others, target=self.target)

    def carrying(self, bears: float) -> Task:
        """Return what the motion into the bin has to heed, held by a seal that bears so much [N]."""
        return Task(Load(self.kind, bears), self.others)


class Scenes:
    """Draws one scene after another into a live world.

    The objects are those that a run of the cell could begin with, the first one spawned is the pick; the
    bins are empty. Scenes whose pick no cup can hold at its middle, or that is out of reach, are not used.

    Args:
        config: The cell file.
        planner: Says what is in reach.
        world: Where the objects are put; the arm must keep out of their way.
        seed: Decides everything random.
    """

    def __init__(self, config: CellConfig, planner: Planner, world: World, seed: int) -> None:
        self._config = config
        self._planner = planner
        self._world = world
        self._rng = np.random.default_rng(seed)
        self._bins = [as_bin(name, bin) for name, bin in config.bins.items()]
        self._tallest = max(kind.height for kind in config.objects.values())

    def next(self) -> Scene:
        """Take away the objects of the last scene and put those of a new one.

        Raises:
            InputError: None of `TRIES` scenes could be used.
        """
        why = ""
        for _ in range(TRIES):
            self.clear()
            bodies = spawn(self._world, self._config, int(self._rng.integers(2**31)))
            bin, slot = self._slot()
            if not bodies:
                why = "nothing was spawned"
                continue
            try:
                scene = self._scene(bodies, bin, slot)
                self._planner.require_reachable(scene.approach)
                self._planner.require_reachable(scene.drop)
            except Unreachable as error:
                why = str(error)
                continue
            return scene
        raise InputError(
            f"none of {TRIES} random scenes of cell {self._config.cell} has an object that can be picked and "
            f"placed; the last one: {why}"
        )

    def clear(self) -> None:
        """Take every object away."""
        for body in tuple(self._world.bodies):
            self._world.remove_object(body)

    def resting_place(self) -> Goal:
        """Return a random drop position, as the arm stands after the pair before the first one."""
        return over(*self._slot(), self._tallest, self._tallest)

    def _slot(self) -> tuple[Bin, int]:
        """Return a random bin and the number of one of its slots."""
        bin = self._bins[int(self._rng.integers(len(self._bins)))]
        return bin, int(self._rng.integers(len(bin.slots)))

    def _scene(self, bodies: tuple[int, ...], bin: Bin, slot: int) -> Scene:
        first, *others = bodies
        kind, motion = self._kind(first), self._config.motion
        x, y, underside = self._standing(first)
        centre = np.array([x, y, underside + kind.height / 2])
        approach = onto(kind, centre, motion.descent, motion.descent_speed)
        place = approach.position[:2]
        surface, bears = self._seal(first, place, underside + kind.height)
        return Scene(
            body=first,
            kind=kind,
            place=place,
            surface=surface + TOUCH,
            bears=bears,
            target=self._obstacle(first, 1),
            others=tuple(self._obstacle(body, number) for number, body in enumerate(others, start=2)),
            approach=approach,
            drop=over(bin, slot, kind.height, self._tallest),
        )

    def _standing(self, body: int) -> tuple[float, float, float]:
        """Return the middle of a body's outline seen from above and the height of its underside [m]."""
        mesh = load_mesh(self._config.objects[self._world.bodies[body]])
        corners = self._world.object_pose(body).apply(mesh.vertices)
        low, high = corners.min(axis=0), corners.max(axis=0)
        x, y = (low[:2] + high[:2]) / 2
        return float(x), float(y), float(low[2])

    def _obstacle(self, body: int, number: int) -> Obstacle:
        kind = self._kind(body)
        x, y, underside = self._standing(body)
        return Obstacle(x, y, kind.radius, underside + kind.height, f"{kind.label}-{number}")

    def _kind(self, body: int) -> ObjectClass:
        label = self._world.bodies[body]
        return weighed(label, self._config.objects[label])

    def _seal(self, body: int, place: tuple[float, float], top: float) -> tuple[float, float]:
        """Return how high the object is under a cup at `place` [m], and the pull that a seal bears there [N].

        Asked twice, for the second time with the cup where it comes to rest: what the rays find on a bent
        surface depends a little on how far away they start.

        Raises:
            Unreachable: None forms there.
        """
        client, tool = self._world.client, self._config.tool
        surface, bears = top + tool.reach, 0.0
        for _ in range(2):
            seal = measure(client, tool_down((*place, surface)), {body}, tool.cup_radius, tool.reach)
            bears = breakaway(seal, tool)
            surface -= seal.distance if seal else 0.0
        if bears < tool.least_force:
            label = self._world.bodies[body]
            raise Unreachable(
                f"a seal at the middle of the {label} bears {bears:.1f} N, too little to hold it"
            )
        return surface, bears
