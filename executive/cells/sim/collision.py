"""Collision check of a planned path: clearance of arm, tool and load from the cell.

The check has a world of its own, because moving the arm of the running world would disturb its physics.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import NamedTuple

import pybullet

from executive.cell.arm import Task
from executive.cell.bins import BIN_THICKNESS
from executive.cell.config import CellConfig
from executive.cell.objects import Load, ObjectClass, Obstacle
from executive.cells.sim.world import World, name_held
from executive.errors import Blocked
from executive.geometry import Array, Pose

ROUNDING_ERROR = 1e-5
"""Largest rounding error of a distance [m]."""
PARKING_POSITION = (0.0, 0.0, 50.0)
"""Position of unused bodies [m]."""


class ClosestApproach(NamedTuple):
    """Distance of a part of the robot from a body of the cell, and the smallest allowed one [m]."""

    part: str
    body: str
    distance: float
    allowed: float

    def __str__(self) -> str:
        relation = f"{self.distance:.3f} m from" if self.distance >= 0 else f"{-self.distance:.3f} m into"
        return f"{self.part} {relation} {self.body}"


class PathClearance:
    """Checks paths of the arm for collisions with table, bins, obstacles and the arm itself.

    A motion may begin closer than the margin to a body (after a stop, or with a held object on the table),
    but must never come closer than that. A held object is modelled as an upright cylinder under the tool; it
    may touch the table and the floor of a bin, where it is picked and placed.

    Attributes:
        world: World of the check; its arm is at the joint positions of the last check.
    """

    def __init__(self, config: CellConfig) -> None:
        self.world = World(config, visuals=False)
        self._margin = config.motion.margin
        self._held: dict[ObjectClass, int] = {}
        self._cylinders: dict[tuple[float, float], list[int]] = {}
        self._obstacles: dict[str, tuple[int, ...]] = {}

    def check(self, path: Array, task: Task = Task()) -> None:
        """Check that the joint positions along a path `(N, n)` [rad] keep the margin of the cell file.

        Raises:
            Blocked: The path violates the margin; the text states both bodies, the distance and the place.
        """
        with self._place_obstacles(task.around):
            self._check(path, task.load)

    def _check(self, path: Array, carrying: Load | None) -> None:
        # A pair within the margin at the start may stay at that distance until it has left the margin once.
        exempt = self._find_nearest(path[0], carrying)
        for q in path[1:]:
            nearest = self._find_nearest(q, carrying)
            for pair, near in nearest.items():
                allowed = min(near.allowed, exempt[pair].distance) if pair in exempt else near.allowed
                if near.distance < allowed - ROUNDING_ERROR:
                    raise Blocked(self._describe(near))
            exempt = {pair: near for pair, near in exempt.items() if pair in nearest}

    def _find_nearest(self, q: Array, carrying: Load | None) -> dict[tuple[str, str], ClosestApproach]:
        """Return the closest approach of every pair within the margin at `q` `(n,)` [rad]."""
        found: dict[tuple[str, str], ClosestApproach] = {}
        for near in self._find_near(q, carrying):
            pair = near.part, near.body
            if pair not in found or near.distance - near.allowed < found[pair].distance - found[pair].allowed:
                found[pair] = near
        return found

    def find_violation(self, q: Array) -> ClosestApproach | None:
        """Return the closest approach of an empty arm at `q` `(n,)` [rad] within the margin, or None."""
        nearest = min(self._find_near(q, None), key=lambda near: near.distance, default=None)
        return nearest if nearest and nearest.distance < nearest.allowed - ROUNDING_ERROR else None

    def close(self) -> None:
        """Close the world of the check."""
        self.world.close()

    def _describe(self, near: ClosestApproach) -> str:
        x, y, z = self.world.tool_pose().position
        return (
            f"the motion would bring {near}, with the tool at ({x:.3f}, {y:.3f}, {z:.3f}) m; "
            f"{self._margin:.3f} m must stay free"
        )

    def _find_near(self, q: Array, carrying: Load | None) -> Iterator[ClosestApproach]:
        """Yield the approaches within the margin at `q` `(n,)` [rad]."""
        client, arm = self.world.client, self.world.arm
        near = client.getClosestPoints  # looked up once, because a look-up takes as long as a call
        client.resetJointStatesMultiDof(arm, range(len(q)), [[angle] for angle in q])
        bodies = {"the table": (self.world.table,), **self.world.bins, **self._obstacles}
        for name, parts in bodies.items():
            for body in parts:
                for point in near(arm, body, self._margin):
                    if point[3] >= self.world.robot.first_moving_link:
                        yield ClosestApproach(self.world.name_link(point[3]), name, point[8], self._margin)
        for one, other in self.world.robot.self_pairs:
            for point in near(arm, arm, self._margin, linkIndexA=one, linkIndexB=other):
                yield ClosestApproach(
                    self.world.name_link(one), self.world.name_link(other), point[8], self._margin
                )
        if carrying is not None:
            yield from self._find_near_held(carrying.kind, bodies)

    def _find_near_held(
        self, carrying: ObjectClass, bodies: Mapping[str, tuple[int, ...]]
    ) -> Iterator[ClosestApproach]:
        held, near = self._find_cylinder(carrying), self.world.client.getClosestPoints
        X_WH = self.world.tool_pose() @ Pose.of([0, 0, carrying.height / 2])
        self.world.client.resetBasePositionAndOrientation(held, X_WH.position, X_WH.quaternion)
        part = name_held(carrying.label)
        for name, parts in bodies.items():
            for body in parts:
                for point in near(held, body, self._margin):
                    floor = self._find_height(name) + BIN_THICKNESS
                    touchable = point[6][2] <= floor + 0.001 and name not in self._obstacles
                    yield ClosestApproach(part, name, point[8], 0.0 if touchable else self._margin)
        for point in near(held, self.world.arm, self._margin):
            if self.world.robot.first_moving_link <= point[4] < self.world.robot.wrist_link:
                yield ClosestApproach(part, self.world.name_link(point[4]), point[8], self._margin)
        self.world.client.resetBasePositionAndOrientation(held, PARKING_POSITION, [0, 0, 0, 1])

    @contextmanager
    def _place_obstacles(self, obstacles: Sequence[Obstacle]) -> Iterator[None]:
        """Put the obstacles into the world as cylinders on the table until the context ends."""
        client, used = self.world.client, Counter[tuple[float, float]]()
        for obstacle in obstacles:
            size = round(obstacle.radius, 4), round(obstacle.top, 4)
            bodies = self._cylinders.setdefault(size, [])
            if len(bodies) == used[size]:
                shape = client.createCollisionShape(pybullet.GEOM_CYLINDER, radius=size[0], height=size[1])
                bodies.append(int(client.createMultiBody(0, shape, basePosition=PARKING_POSITION)))
            body = bodies[used[size]]
            used[size] += 1
            client.resetBasePositionAndOrientation(
                body, [obstacle.x, obstacle.y, obstacle.top / 2], [0, 0, 0, 1]
            )
            self._obstacles[obstacle.name] = (*self._obstacles.get(obstacle.name, ()), body)
        try:
            yield
        finally:
            for parts in self._obstacles.values():
                for body in parts:
                    client.resetBasePositionAndOrientation(body, PARKING_POSITION, [0, 0, 0, 1])
            self._obstacles = {}

    def _find_height(self, body: str) -> float:
        """Return the height [m] of a bin by its name, 0 for other bodies."""
        bin = self.world.config.bins.get(body)
        return bin.position[2] if bin else 0.0

    def _find_cylinder(self, carrying: ObjectClass) -> int:
        """Return the body that models a held object."""
        if carrying not in self._held:
            client = self.world.client
            shape = client.createCollisionShape(
                pybullet.GEOM_CYLINDER, radius=carrying.radius + carrying.ring, height=carrying.height
            )
            self._held[carrying] = int(client.createMultiBody(0, shape, basePosition=PARKING_POSITION))
        return self._held[carrying]
