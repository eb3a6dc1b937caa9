"""Collision check of planned paths of arm, tool and load against the cell, and of the arm against itself.

The check uses a separate world, because moving the arm of the running world would disturb the physics.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

import pybullet

from executive.cell.arm import Task
from executive.cell.bins import BIN_THICKNESS
from executive.cell.config import CellConfig
from executive.cell.objects import Load, ObjectClass, Obstacle
from executive.cells.sim.world import DISTANCE, LINK_A, LINK_B, POSITION_B, World, name_load
from executive.errors import Blocked
from executive.geometry import Array, Pose

ROUNDING_ERROR = 1e-5
"""Maximum rounding error of a distance [m]."""
SUPPORT_TOLERANCE = 0.001
"""Maximum height [m] above the floor of a bin at which a contact of the load is a contact with the floor."""


class ClosestApproach(NamedTuple):
    """Closest approach between a part of the robot and a body.

    Attributes:
        part, body: Names of the part and of the body for messages.
        distance: Distance between part and body [m], negative for a penetration.
        min_distance: Required minimum distance [m].
    """

    part: str
    body: str
    distance: float
    min_distance: float

    @property
    def clearance(self) -> float:
        """Distance beyond the minimum distance [m], negative for a violation."""
        return self.distance - self.min_distance

    def __str__(self) -> str:
        relation = f"{self.distance:.3f} m from" if self.distance >= 0 else f"{-self.distance:.3f} m into"
        return f"{self.part} {relation} {self.body}"


class ClearanceChecker:
    """Checks paths of the arm for collisions with table, bins, obstacles and the arm itself.

    After a stop, or with a held object on the table, a motion may begin closer to a body than the margin.
    The distance from this body must then not decrease. A held object is modelled by an upright cylinder
    under the tool, which may touch the table and the floors of bins.

    Attributes:
        world: World of the check, whose arm is at the last checked joint positions.
    """

    def __init__(self, config: CellConfig) -> None:
        self.world = World(config, visuals=False)
        self._margin = config.motion.margin
        self._get_cylinder = functools.cache(self._add_cylinder)
        """Returns the body of the load (number 0) or of an obstacle, by radius [m], height [m] and number."""
        self._obstacles: dict[str, tuple[int, ...]] = {}
        """Bodies of the current obstacles, by name."""

    def check(self, path: Array, task: Task = Task()) -> None:
        """Check that the joint positions along a path `(N, n)` [rad] keep the margin of the cell file.

        Raises:
            Blocked: The path violates the margin; the message states bodies, distance and tool position.
        """
        with self._place_obstacles(task.obstacles):
            # A pair that starts closer than the margin must keep its initial distance until the pair has been
            # apart by the margin once. Every other pair must keep the margin.
            start_approaches = self._find_closest_approaches(path[0], task.load)
            start_distances = {pair: approach.distance for pair, approach in start_approaches.items()}
            for q in path[1:]:
                approaches = self._find_closest_approaches(q, task.load)
                for pair, approach in approaches.items():
                    min_distance = min(approach.min_distance, start_distances.get(pair, math.inf))
                    if approach.distance < min_distance - ROUNDING_ERROR:
                        raise Blocked(self._describe_violation(approach))
                start_distances = {pair: d for pair, d in start_distances.items() if pair in approaches}

    def _find_closest_approaches(self, q: Array, load: Load | None) -> dict[tuple[str, str], ClosestApproach]:
        """Return the closest approach of each pair of part and body within the margin at `q` `(n,)` [rad]."""
        closest: dict[tuple[str, str], ClosestApproach] = {}
        for approach in self._find_approaches(q, load):
            pair = approach.part, approach.body
            if pair not in closest or approach.clearance < closest[pair].clearance:
                closest[pair] = approach
        return closest

    def find_violation(self, q: Array) -> ClosestApproach | None:
        """Return the closest approach of the unloaded arm at `q` `(n,)` [rad], or None if it is allowed."""
        closest = min(self._find_approaches(q, None), key=lambda approach: approach.distance, default=None)
        return closest if closest and closest.distance < closest.min_distance - ROUNDING_ERROR else None

    def close(self) -> None:
        """Close the world of the check."""
        self.world.close()

    def _describe_violation(self, approach: ClosestApproach) -> str:
        x, y, z = self.world.get_tool_pose().position
        return (
            f"the motion would bring {approach}, with the tool at ({x:.3f}, {y:.3f}, {z:.3f}) m; "
            f"the minimum clearance is {self._margin:.3f} m"
        )

    def _find_approaches(self, q: Array, load: Load | None) -> Iterator[ClosestApproach]:
        """Yield the approaches of arm, tool and load within the margin at `q` `(n,)` [rad]."""
        client, arm = self.world.client, self.world.arm
        get_points = client.getClosestPoints  # looked up once, because a look-up takes as long as a call
        client.resetJointStatesMultiDof(arm, range(len(q)), [[angle] for angle in q])
        name_link = self.world.name_link
        bodies = [("the table", self.world.table), *self.world.bin_bodies.items()]
        bodies += [(name, body) for name, cylinders in self._obstacles.items() for body in cylinders]
        for name, body in bodies:
            for point in get_points(arm, body, self._margin):
                if point[LINK_A] >= self.world.robot.first_collision_link:
                    yield ClosestApproach(name_link(point[LINK_A]), name, point[DISTANCE], self._margin)
        for link_a, link_b in self.world.robot.self_collision_pairs:
            for point in get_points(arm, arm, self._margin, linkIndexA=link_a, linkIndexB=link_b):
                yield ClosestApproach(name_link(link_a), name_link(link_b), point[DISTANCE], self._margin)
        if load is not None:
            yield from self._find_load_approaches(load.object_class, bodies)

    def _find_load_approaches(
        self, load: ObjectClass, bodies: Sequence[tuple[str, int]]
    ) -> Iterator[ClosestApproach]:
        """Yield the approaches within the margin of the load to the arm and to the named `bodies`."""
        load_body = self._get_cylinder(load.radius + load.contact_radius, load.height, 0)
        get_points = self.world.client.getClosestPoints
        X_WH = self.world.get_tool_pose() @ Pose.of([0, 0, load.height / 2])
        self.world.client.resetBasePositionAndOrientation(load_body, X_WH.position, X_WH.quaternion)
        part = name_load(load.label)
        for name, body in bodies:
            bin = self.world.config.bins.get(name)
            max_support_height = (bin.position[2] if bin else 0.0) + BIN_THICKNESS + SUPPORT_TOLERANCE
            for point in get_points(load_body, body, self._margin):
                is_support = point[POSITION_B][2] <= max_support_height and name not in self._obstacles
                yield ClosestApproach(part, name, point[DISTANCE], 0.0 if is_support else self._margin)
        for point in get_points(load_body, self.world.arm, self._margin):
            if self.world.robot.first_collision_link <= point[LINK_B] < self.world.robot.wrist_link:
                link_name = self.world.name_link(point[LINK_B])
                yield ClosestApproach(part, link_name, point[DISTANCE], self._margin)

    @contextmanager
    def _place_obstacles(self, obstacles: Sequence[Obstacle]) -> Iterator[None]:
        """Represent the obstacles by cylinders on the table until the context ends."""
        for number, obstacle in enumerate(obstacles, 1):
            body = self._get_cylinder(round(obstacle.radius, 4), round(obstacle.top, 4), number)
            position = [obstacle.x, obstacle.y, obstacle.top / 2]
            self.world.client.resetBasePositionAndOrientation(body, position, [0, 0, 0, 1])
            self._obstacles[obstacle.name] = (*self._obstacles.get(obstacle.name, ()), body)
        try:
            yield
        finally:
            self._obstacles = {}

    def _add_cylinder(self, radius: float, height: float, number: int) -> int:
        """Add a cylinder and return the body; `number` distinguishes cylinders of equal size in the cache."""
        del number
        client = self.world.client
        shape = client.createCollisionShape(pybullet.GEOM_CYLINDER, radius=radius, height=height)
        return int(client.createMultiBody(0, shape))
