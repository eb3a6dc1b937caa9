"""How near the arm, its tool and what it holds come to the cell along a motion not yet made.

Asked in a world of its own: moving the arm of the running world to look would disturb its physics.
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
from executive.cells.sim.world import World, held_part
from executive.errors import Blocked
from executive.geometry import Array, Pose

ROUNDING_ERROR = 1e-5
"""Difference of distances that is rounding [m]."""
PARKING_POSITION = (0.0, 0.0, 50.0)


class ClosestApproach(NamedTuple):
    """A part of the robot near a body of the cell."""

    part: str
    body: str
    distance: float
    allowed: float

    def __str__(self) -> str:
        how = f"{self.distance:.3f} m from" if self.distance >= 0 else f"{-self.distance:.3f} m into"
        return f"{self.part} {how} {self.body}"


class PathClearance:
    """Checks paths of the arm against table, bins, the arm itself and what stands around.

    A motion may begin closer than the margin to something (the arm may have been stopped there, a held
    object lies on the table), but nowhere may it come closer than that. A held object, taken as an
    upright cylinder under the tool, may touch the table and a bin's floor, where it is picked and put.

    Attributes:
        world: Where it looks; the arm in it stands wherever it was asked about last.
    """

    def __init__(self, config: CellConfig) -> None:
        self.world = World(config, visuals=False)
        self._margin = config.motion.margin
        self._held: dict[ObjectClass, int] = {}
        self._cylinders: dict[tuple[float, float], list[int]] = {}
        self._around: dict[str, tuple[int, ...]] = {}

    def check(self, path: Array, task: Task = Task()) -> None:
        """Make sure that joint positions along a path `(N, n)` [rad] keep the cell file's margin.

        Raises:
            Blocked: They do not; the text names the two bodies, the distance and the place.
        """
        with self._standing(task.around):
            self._check(path, task.load)

    def _check(self, path: Array, carrying: Load | None) -> None:
        # Closer than allowed may be only what was so from the beginning, until it has once been farther away.
        spared = self._nearest(path[0], carrying)
        for q in path[1:]:
            nearest = self._nearest(q, carrying)
            for pair, near in nearest.items():
                allowed = min(near.allowed, spared[pair].distance) if pair in spared else near.allowed
                if near.distance < allowed - ROUNDING_ERROR:
                    raise Blocked(self._text(near))
            spared = {pair: near for pair, near in spared.items() if pair in nearest}

    def _nearest(self, q: Array, carrying: Load | None) -> dict[tuple[str, str], ClosestApproach]:
        """Return the nearest place of every pair that is nearer than the margin at `q`."""
        found: dict[tuple[str, str], ClosestApproach] = {}
        for near in self._near(q, carrying):
            pair = near.part, near.body
            if pair not in found or near.distance - near.allowed < found[pair].distance - found[pair].allowed:
                found[pair] = near
        return found

    def too_near(self, q: Array) -> ClosestApproach | None:
        """Return what an empty arm at `q` `(n,)` [rad] brings nearest, if nearer than the margin, or None."""
        nearest = min(self._near(q, None), key=lambda near: near.distance, default=None)
        return nearest if nearest and nearest.distance < nearest.allowed - ROUNDING_ERROR else None

    def close(self) -> None:
        """Give the planning world back."""
        self.world.close()

    def _text(self, near: ClosestApproach) -> str:
        x, y, z = self.world.tool_pose().position
        return (
            f"the motion would bring {near}, with the tool at ({x:.3f}, {y:.3f}, {z:.3f}) m; "
            f"{self._margin:.3f} m must stay free"
        )

    def _near(self, q: Array, carrying: Load | None) -> Iterator[ClosestApproach]:
        """Yield what is nearer than its margin at `q`."""
        client, arm = self.world.client, self.world.arm
        near = client.getClosestPoints  # looked up once: that costs as much as asking
        client.resetJointStatesMultiDof(arm, range(len(q)), [[angle] for angle in q])
        bodies = {"the table": (self.world.table,), **self.world.bins, **self._around}
        for name, parts in bodies.items():
            for body in parts:
                for point in near(arm, body, self._margin):
                    if point[3] >= self.world.robot.first_moving_link:
                        yield ClosestApproach(self.world.part_of(point[3]), name, point[8], self._margin)
        for one, other in self.world.robot.self_pairs:
            for point in near(arm, arm, self._margin, linkIndexA=one, linkIndexB=other):
                yield ClosestApproach(
                    self.world.part_of(one), self.world.part_of(other), point[8], self._margin
                )
        if carrying is not None:
            yield from self._near_held(carrying.kind, bodies)

    def _near_held(
        self, carrying: ObjectClass, bodies: Mapping[str, tuple[int, ...]]
    ) -> Iterator[ClosestApproach]:
        held, near = self._body(carrying), self.world.client.getClosestPoints
        X_WH = self.world.tool_pose() @ Pose.of([0, 0, carrying.height / 2])
        self.world.client.resetBasePositionAndOrientation(held, X_WH.position, X_WH.quaternion)
        part = held_part(carrying.label)
        for name, parts in bodies.items():
            for body in parts:
                for point in near(held, body, self._margin):
                    floor = self._floor(name) + BIN_THICKNESS
                    touchable = point[6][2] <= floor + 0.001 and name not in self._around
                    yield ClosestApproach(part, name, point[8], 0.0 if touchable else self._margin)
        for point in near(held, self.world.arm, self._margin):
            if self.world.robot.first_moving_link <= point[4] < self.world.robot.wrist_link:
                yield ClosestApproach(part, self.world.part_of(point[4]), point[8], self._margin)
        self.world.client.resetBasePositionAndOrientation(held, PARKING_POSITION, [0, 0, 0, 1])

    @contextmanager
    def _standing(self, around: Sequence[Obstacle]) -> Iterator[None]:
        """Have what stands around in the world meanwhile, as cylinders on the table."""
        client, used = self.world.client, Counter[tuple[float, float]]()
        for obstacle in around:
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
            self._around[obstacle.name] = (*self._around.get(obstacle.name, ()), body)
        try:
            yield
        finally:
            for there in self._around.values():
                for body in there:
                    client.resetBasePositionAndOrientation(body, PARKING_POSITION, [0, 0, 0, 1])
            self._around = {}

    def _floor(self, body: str) -> float:
        bin = self.world.config.bins.get(body)
        return bin.position[2] if bin else 0.0

    def _body(self, carrying: ObjectClass) -> int:
        if carrying not in self._held:
            client = self.world.client
            shape = client.createCollisionShape(
                pybullet.GEOM_CYLINDER, radius=carrying.radius + carrying.ring, height=carrying.height
            )
            self._held[carrying] = int(client.createMultiBody(0, shape, basePosition=PARKING_POSITION))
        return self._held[carrying]
