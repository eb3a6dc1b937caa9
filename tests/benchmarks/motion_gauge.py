"""Distances of arm, tool and load from anything that they must not touch."""

from __future__ import annotations

import math
from collections.abc import Iterator

from executive.sim.clearance import FIRST_MOVING, SELF_PAIRS, WRIST
from executive.sim.world import World, held_part

RANGE = 0.03
"""Largest distance that is measured [m]."""


class Gauge:
    """Keeps the least distance of all moments that it measures.

    Two things that were nearer than the margin when a motion began (two objects side by side, one of them
    now in the tool, or the load and the table) do not count in that motion.

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
        self._spared: set[str] = set()
        self._touched: int | None = None
        self.least = math.inf
        self.nearest = "nothing"

    def begin(self, held: int | None, touched: int | None = None) -> None:
        """Begin a motion with the body `held` in the tool; `touched` is the body that the tool may touch."""
        self._touched = touched
        self._spared = {pair for distance, pair in self._measure_pairs(held) if distance < self._margin}

    def measure(self, held: int | None) -> None:
        """Measure the distances of this moment; `held` is the body in the tool."""
        for distance, pair in self._measure_pairs(held):
            if pair not in self._spared and distance < self.least:
                self.least, self.nearest = distance, pair

    def _measure_pairs(self, held: int | None) -> Iterator[tuple[float, str]]:
        world, near = self._world, self._world.client.getClosestPoints
        bins = (body for bodies in world.bins.values() for body in bodies)
        things = [body for body in (world.table, *bins, *world.bodies) if body not in (held, self._touched)]
        load = "" if held is None else held_part(world.bodies[held])
        for body in things:
            for point in near(world.arm, body, RANGE):
                if point[3] >= FIRST_MOVING:
                    yield point[8], f"{world.part_of(point[3])} - {world.name_of(body)}"
            for point in near(held, body, RANGE) if load else ():
                yield point[8], f"{load} - {world.name_of(body)}"
        for one, other in SELF_PAIRS:
            for point in near(world.arm, world.arm, RANGE, linkIndexA=one, linkIndexB=other):
                yield point[8], f"{world.part_of(one)} - {world.part_of(other)}"
        for point in near(held, world.arm, RANGE) if load else ():
            if FIRST_MOVING <= point[4] < WRIST:
                yield point[8], f"{load} - {world.part_of(point[4])}"
