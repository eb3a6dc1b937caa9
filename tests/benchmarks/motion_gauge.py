"""Distances of arm, tool and load from anything that they must not touch."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from executive.motion.surroundings import LOOKED_AT
from executive.sim.clearance import FIRST_MOVING, SELF_PAIRS, WRIST
from executive.sim.world import World, held_part
from tests.benchmarks.motion_scenes import Scene

RANGE = 0.03
"""Largest distance that is measured [m]."""
MAX_OFF_LINE = 0.001
"""Horizontal distance from the straight way down within which the tool is on it [m]."""
PRECISION = 1e-5
"""Precision of distances and places in the live world [m]."""


class Gauge:
    """Keeps the least distance of all moments that it measures.

    Things that may be touched do not count: the object to pick while the tool is on the guarded last part of
    the way down, and the table under the load until the tool has left the place by `LOOKED_AT`. A thing that
    was nearer than the margin when the motion began (two objects side by side, one of them now in the tool)
    does not count until it has been farther away once, unless it comes nearer still.

    Args:
        world: The live world.
        margin: Distance to be kept [m].

    Attributes:
        least: The least distance so far [m].
        nearest: The two things with that distance.
    """

    def __init__(self, world: World, margin: float) -> None:
        self._world = world
        self._margin = margin
        self._spared: dict[str, float] = {}
        self.least = math.inf
        self.nearest = "nothing"

    def begin(self, scene: Scene, held: int | None = None) -> None:
        """Spare the things nearer than the margin as a motion begins; `held` is the body in the tool."""
        nearest = self._measure_all(scene, held)
        self._spared = {pair: distance for pair, distance in nearest.items() if distance < self._margin}

    def measure(self, scene: Scene, held: int | None = None) -> None:
        """Measure the distances of this moment; `held` is the body in the tool."""
        nearest = self._measure_all(scene, held)
        self._spared = {
            pair: distance
            for pair, distance in self._spared.items()
            if distance - PRECISION <= nearest.get(pair, math.inf) < self._margin
        }
        for pair, distance in nearest.items():
            if pair not in self._spared and distance < self.least:
                self.least, self.nearest = distance, pair

    def _measure_all(self, scene: Scene, held: int | None) -> dict[str, float]:
        """Return the least distance [m] of each pair of things."""
        nearest: dict[str, float] = {}
        for distance, pair in self._measure_pairs(scene, held):
            nearest[pair] = min(distance, nearest.get(pair, math.inf))
        return nearest

    def _measure_pairs(self, scene: Scene, held: int | None) -> Iterator[tuple[float, str]]:
        world, near = self._world, self._world.client.getClosestPoints
        allowed = self._find_touchable(scene, held)
        static = (world.table, *(body for bodies in world.bins.values() for body in bodies))
        things = [body for body in (*static, *world.bodies) if body != held]
        for body in things:
            if held is not None or body not in allowed:
                for point in near(world.arm, body, RANGE):
                    if point[3] >= FIRST_MOVING:
                        yield point[8], f"{world.part_of(point[3])} - {world.name_of(body)}"
        for one, other in SELF_PAIRS:
            for point in near(world.arm, world.arm, RANGE, linkIndexA=one, linkIndexB=other):
                yield point[8], f"{world.part_of(one)} - {world.part_of(other)}"
        if held is None:
            return
        for body in things:
            if body not in allowed:
                for point in near(held, body, RANGE):
                    yield point[8], f"{self._name_load(held)} - {world.name_of(body)}"
        for point in near(held, world.arm, RANGE):
            if FIRST_MOVING <= point[4] < WRIST:
                yield point[8], f"{self._name_load(held)} - {world.part_of(point[4])}"

    def _find_touchable(self, scene: Scene, held: int | None) -> tuple[int, ...]:
        """Return the body that may be touched just now by the tool, or by the load."""
        x, y, z = self._world.tool_pose().position
        off_line = float(np.hypot(x - scene.approach.position[0], y - scene.approach.position[1]))
        if held is not None:
            return (self._world.table,) if off_line <= LOOKED_AT else ()
        guarded = scene.approach.position[2] + scene.approach.guarded + PRECISION
        return (scene.body,) if off_line <= MAX_OFF_LINE and z <= guarded else ()

    def _name_load(self, held: int) -> str:
        return held_part(self._world.bodies[held])
