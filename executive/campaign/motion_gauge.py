"""How near arm, tool and load come to what they must not touch, and what they touch, in the live world."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from executive.campaign.motion_scenes import Scene
from executive.motion.surroundings import LOOKED_AT
from executive.sim.clearance import FIRST_MOVING, SELF_PAIRS, WRIST
from executive.sim.contacts import PRESSING
from executive.sim.world import World, held_part

RANGE = 0.03
"""Distance up to which things are looked at [m]."""
OFF_LINE = 0.001
"""How far beside the straight way down the tool may be to count as on it [m]."""
EXACT = 1e-5
"""What distances and places in the live world are exact to [m]: the tool follows its path to microns."""


class Near(NamedTuple):
    """A distance [m], and of what to what."""

    distance: float
    what: str


class Gauge:
    """Keeps the least distance and the contacts of all moments it is shown.

    What may be touched does not count: the object to pick while the tool is on the guarded last part of the
    way down, and the table under what was picked until the tool has left the place by `LOOKED_AT`. Nor does
    what stood nearer than the margin when the motion began (two objects side by side, one of them now in
    the tool), until it has been farther away once, unless it comes nearer still.

    Args:
        world: Where it looks.
        margin: What is to be kept [m].

    Attributes:
        least: The least distance so far.
        contacts: What touched what although it must not.
    """

    def __init__(self, world: World, margin: float) -> None:
        self._world = world
        self._margin = margin
        self._spared: dict[str, float] = {}
        self.least = Near(math.inf, "nothing")
        self.contacts: set[str] = set()

    def begin(self, scene: Scene, held: int | None = None) -> None:
        """Take note of what is nearer than the margin as a motion begins; `held` is the body in the tool."""
        nearest = self._nearest(scene, held)
        self._spared = {what: distance for what, distance in nearest.items() if distance < self._margin}

    def measure(self, scene: Scene, held: int | None = None) -> None:
        """Look at the distances of this moment; `held` is the body in the tool."""
        nearest = self._nearest(scene, held)
        self._spared = {
            what: distance
            for what, distance in self._spared.items()
            if distance - EXACT <= nearest.get(what, math.inf) < self._margin
        }
        counting = (Near(distance, what) for what, distance in nearest.items() if what not in self._spared)
        self.least = min((self.least, *counting))

    def feel(self, scene: Scene, held: int | None = None) -> None:
        """Look at the contacts of the physics step just made."""
        client, arm = self._world.client, self._world.arm
        below = self._below(scene, held)
        for point in client.getContactPoints(bodyA=arm) or ():
            if point[9] > PRESSING and point[3] >= FIRST_MOVING and point[2] not in (held, arm, *below):
                self.contacts.add(f"{self._world.part_of(point[3])} - {self._world.name_of(point[2])}")
        if held is not None:
            for point in client.getContactPoints(bodyA=held) or ():
                if point[9] > PRESSING and point[2] not in (arm, *below):
                    self.contacts.add(f"{self._load(held)} - {self._world.name_of(point[2])}")

    def _nearest(self, scene: Scene, held: int | None) -> dict[str, float]:
        """Return the least distance of this moment [m] by what is near what."""
        nearest: dict[str, float] = {}
        for distance, what in self._distances(scene, held):
            nearest[what] = min(distance, nearest.get(what, math.inf))
        return nearest

    def _distances(self, scene: Scene, held: int | None) -> Iterator[Near]:
        world, client = self._world, self._world.client
        below = self._below(scene, held)
        static = (world.table, *(body for bodies in world.bins.values() for body in bodies))
        things = [body for body in (*static, *world.bodies) if body != held]
        for body in things:
            if held is None and body in below:
                continue
            for point in client.getClosestPoints(world.arm, body, RANGE):
                if point[3] >= FIRST_MOVING:
                    yield Near(point[8], f"{world.part_of(point[3])} - {world.name_of(body)}")
        for one, other in SELF_PAIRS:
            for point in client.getClosestPoints(
                world.arm, world.arm, RANGE, linkIndexA=one, linkIndexB=other
            ):
                yield Near(point[8], f"{world.part_of(one)} - {world.part_of(other)}")
        if held is None:
            return
        for body in things:
            if body in below:
                continue
            for point in client.getClosestPoints(held, body, RANGE):
                yield Near(point[8], f"{self._load(held)} - {world.name_of(body)}")
        for point in client.getClosestPoints(held, world.arm, RANGE):
            if FIRST_MOVING <= point[4] < WRIST:
                yield Near(point[8], f"{self._load(held)} - {world.part_of(point[4])}")

    def _below(self, scene: Scene, held: int | None) -> tuple[int, ...]:
        """Return the body that may be touched just now by what is lowest: by the tool, or by the load."""
        x, y, z = self._world.tool_pose().position
        away = float(np.hypot(x - scene.place[0], y - scene.place[1]))
        if held is None:
            guarded = scene.approach.position[2] + scene.approach.guarded
            return (scene.body,) if away <= OFF_LINE and z <= guarded + EXACT else ()
        return (self._world.table,) if away <= LOOKED_AT else ()

    def _load(self, held: int) -> str:
        return held_part(self._world.bodies[held])
