"""Collision check of planned paths of arm, tool and load against the cell, and of the arm against itself.

The check uses a separate world, because moving the arm of the running world would disturb the physics.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Container, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pybullet

from executive.cell.arm import Task
from executive.cell.bins import BIN_THICKNESS
from executive.cell.config import CellConfig
from executive.cell.objects import Load, ObjectClass, Obstacle
from executive.cells.sim.world import DISTANCE, LINK_A, POSITION_B, World, name_load
from executive.errors import Blocked
from executive.geometry import Array

ROUNDING_ERROR = 1e-5
"""Maximum rounding error of a distance [m]."""
SEARCH_DISTANCE = 0.15
"""Distance beyond the margin up to which the distances of bodies are computed [m]."""
SUPPORT_TOLERANCE = 0.001
"""Maximum height [m] above the floor of a bin at which a contact of the load is a contact with the floor."""


ClosestPoints: TypeAlias = tuple[Any, ...]
"""Closest points of two bodies A and B from PyBullet: values with the indices `LINK_A`, `POSITION_B`, ...."""


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

    Two bodies whose distance is known need no further query until a part of the arm may have moved by that
    distance. The upper bound of the movement is the sum of all joint movements, each multiplied by the length
    of the arm beyond the joint.

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
        # The functions are looked up once, because a look-up takes as long as a call.
        self._get_points = self.world.client.getClosestPoints
        self._reach = self._compute_reach()
        self._movement = 0.0
        """Upper bound of the movement of a point of arm or load since the start of the path [m]."""
        self._clear_until: dict[tuple[int, ...], float] = {}
        """Movement [m] up to which two bodies are farther apart than the margin, by bodies and links."""

    def check(self, path: Array, task: Task = Task()) -> None:
        """Check that the joint positions along a path `(N, n)` [rad] keep the margin of the cell file.

        Raises:
            Blocked: The path violates the margin; the message states bodies, distance and tool position.
        """
        with self._place_obstacles(task.obstacles):
            # A pair that starts closer than the margin must keep its initial distance until the pair has been
            # apart by the margin once. Every other pair must keep the margin.
            self._movement, self._clear_until = 0.0, {}
            load = task.load.object_class if task.load else None
            load_size = load.height + load.radius + load.contact_radius if load else 0.0
            start_approaches = self._find_closest_approaches(path[0], task.load)
            start_distances = {pair: approach.distance for pair, approach in start_approaches.items()}
            for q, last_q in zip(path[1:], path, strict=False):
                self._movement += float(np.abs(q - last_q) @ (self._reach + load_size))
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
        self._movement, self._clear_until = 0.0, {}
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
        world, arm = self.world, self.world.arm
        first_link, name_link = world.robot.first_collision_link, world.name_link
        world.client.resetJointStatesMultiDof(arm, range(len(q)), [[angle] for angle in q])
        bodies = [("the table", world.table), *world.bin_bodies.items()]
        bodies += [(name, body) for name, cylinders in self._obstacles.items() for body in cylinders]
        for name, body in bodies:
            for points in self._find_points((arm, body), range(first_link, world.tool_index + 1)):
                yield ClosestApproach(name_link(points[LINK_A]), name, points[DISTANCE], self._margin)
        for link_a, link_b in world.robot.self_collision_pairs:
            for points in self._find_points((arm, arm, link_a, link_b)):
                yield ClosestApproach(name_link(link_a), name_link(link_b), points[DISTANCE], self._margin)
        if load is not None:
            yield from self._find_load_approaches(load.object_class, bodies)

    def _find_points(
        self, pair: tuple[int, ...], links: Container[int] | None = None
    ) -> Sequence[ClosestPoints]:
        """Return the closest points within the margin of two bodies, or of one link of each body.

        With `links`, only these links of the first body count. No query is needed while the bodies cannot
        have moved to within the margin since the last query.
        """
        if self._movement < self._clear_until.get(pair, -math.inf):
            return ()
        body_a, body_b, *link_pair = pair
        max_distance = self._margin + SEARCH_DISTANCE
        all_points = self._get_points(body_a, body_b, max_distance, *link_pair)
        all_points = [points for points in all_points if links is None or points[LINK_A] in links]
        distance = min((points[DISTANCE] for points in all_points), default=max_distance)
        self._clear_until[pair] = self._movement + distance - self._margin - ROUNDING_ERROR
        return [points for points in all_points if points[DISTANCE] <= self._margin]

    def _find_load_approaches(
        self, load: ObjectClass, bodies: Sequence[tuple[str, int]]
    ) -> Iterator[ClosestApproach]:
        """Yield the approaches within the margin of the load to the arm and to the named `bodies`."""
        world, client, robot = self.world, self.world.client, self.world.robot
        load_body = self._get_cylinder(load.radius + load.contact_radius, load.height, 0)
        flange = client.getLinkState(world.arm, world.flange_index, computeForwardKinematics=True)[4:6]
        offset = robot.flange_offset + world.config.tool.length + load.height / 2
        load_pose = client.multiplyTransforms(*flange, [0, 0, offset], [0, 0, 0, 1])
        client.resetBasePositionAndOrientation(load_body, *load_pose)
        part = name_load(load.label)
        for name, body in bodies:
            bin = world.config.bins.get(name)
            max_support_height = (bin.position[2] if bin else 0.0) + BIN_THICKNESS + SUPPORT_TOLERANCE
            for points in self._find_points((load_body, body)):
                is_low = points[POSITION_B][2] <= max_support_height
                min_distance = 0.0 if is_low and name not in self._obstacles else self._margin
                yield ClosestApproach(part, name, points[DISTANCE], min_distance)
        links = range(robot.first_collision_link, robot.wrist_link)
        for points in self._find_points((world.arm, load_body), links):
            yield ClosestApproach(part, world.name_link(points[LINK_A]), points[DISTANCE], self._margin)

    def _compute_reach(self) -> Array:
        """Return the maximum distance of a point of the arm from the axis of each joint `(n,)` [m]."""
        world = self.world
        states = world.client.getLinkStates(world.arm, range(world.robot.joint_count))
        origins = np.array([*(state[4] for state in states), world.get_tool_pose().position])
        lengths = np.linalg.norm(np.diff(origins, axis=0), axis=1)
        return np.cumsum(lengths[::-1])[::-1] + world.robot.link_radius

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
