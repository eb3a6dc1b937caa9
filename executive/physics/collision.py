"""Collision check of planned paths of arm, tool and load against the cell, and of the arm against itself.

The check uses a separate world, because moving the arm of the running world would disturb the physics.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Sequence
from functools import lru_cache
from operator import attrgetter
from typing import NamedTuple

import numpy as np
import pybullet
from pybullet_utils.bullet_client import BulletClient

from executive.cell.arm import Task
from executive.cell.config import CellConfig
from executive.cell.objects import BIN_THICKNESS, ObjectClass, Obstacle
from executive.errors import Blocked
from executive.geometry import Array, format_point
from executive.physics.cell_world import (
    DISTANCE,
    LINK_A,
    POSITION_B,
    CellWorld,
    load_urdf_text,
    name_load,
)

ROUNDING_ERROR = 1e-5
"""Maximum rounding error of a distance [m]."""
START_TOLERANCE = 1e-4
"""Distance by which a part may come closer than at the start [m]; lines of the tool deviate by 0.02 mm."""
SEARCH_DISTANCE = 0.1
"""Distances that exceed the margin by more than this value are not computed [m]."""
MAX_CYLINDER_COUNT = 300
"""Number of stored cylinders above which all are removed; each needs 10 kB."""
JOINT_AXIS = 13
"""Index of the axis of the joint in the information about a joint of PyBullet."""
WRIST_JOINT_COUNT = 2
"""Number of the last joints, whose links a held object is permitted to touch."""
SAMPLE_COUNT = 200
"""Number of random poses in which the pairs of links that can collide are searched."""
NEAR_DISTANCE = 0.03
"""Maximum distance in one of these poses of two links that can collide [m]."""
MAX_TOUCH_FRACTION = 0.9
"""Maximum fraction of these poses in which two links touch; a larger fraction is due to their hulls."""
SUPPORT_TOLERANCE = 0.001
"""Maximum height above the table or the floor of a bin at which a contact supports the load [m]."""


class BodyPair(NamedTuple):
    """Two bodies of which at least one moves with the arm.

    Attributes:
        bodies: Indices of both bodies.
        link_pair: Indices of two links of the arm, or () if all links of the bodies count.
        links: Links of the first body whose distances count.
        joints: Indices of the joints that change the distance, from 0.
        body_name: Name of the second body in messages; "" for the pair of arm and load, whose messages name
            the load first, and then the nearest link of the arm.
        load_name: Name of the load if it belongs to the pair, else "".
        support_height: Height in the world up to which the second body supports the load [m].
    """

    bodies: tuple[int, int]
    links: Collection[int]
    joints: Sequence[int]
    body_name: str = ""
    load_name: str = ""
    support_height: float = -math.inf
    link_pair: tuple[int, ...] = ()


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

    def __str__(self) -> str:
        relation = f"{self.distance:.3f} m from" if self.distance >= 0 else f"{-self.distance:.3f} m into"
        return f"{self.part} {relation} {self.body}"


class ClearanceChecker:
    """Checks paths of the arm for collisions with table, bins, obstacles and the arm itself.

    After a stop, or with a held object on the table, a motion may begin closer to a body than the margin.
    The distance from this body must then not decrease. A held object is modelled by an upright cylinder
    under the tool, which may touch the table and the floors of bins.

    The check is a conservative advancement: two bodies whose distance is known need no further query until a
    part of the arm may have moved by that distance. The upper bound of the movement is the sum of the joint
    movements, each multiplied by the maximum distance of a point of the arm from the axis of the joint.

    Attributes:
        world: World of the check, whose arm is at the last joint positions that needed a query.
        self_collision_pairs: Indices of the links that can collide with each other.
    """

    def __init__(self, config: CellConfig) -> None:
        self.world = CellWorld(config, visuals=False)
        self._margin = config.motion.margin
        self._cylinders: dict[tuple[float, float, int], int] = {}
        """Body of the load (number 0) or of an obstacle, by radius [m], height [m] and number."""
        # The function is looked up once, because a look-up takes as long as a call.
        self._get_closest_points = self.world.client.getClosestPoints
        self._radii = self._compute_max_radii()
        self.self_collision_pairs = find_self_collision_pairs(self.world)

    def check(self, path: Array, task: Task = Task()) -> None:
        """Check that the joint positions along a path `(N, n)` [rad] keep the margin of the cell file.

        Raises:
            Blocked: The path violates the margin; the message states bodies, distance and tool position.
        """
        load = task.load
        load_size = load.height + load.radius + load.contact_radius if load else 0.0
        pairs = self._list_pairs(load, self._place_obstacles(task.obstacles))
        self.world.set_opening(task.opening)
        movements = np.abs(np.diff(path, axis=0, prepend=path[:1])).cumsum(axis=0) * (self._radii + load_size)
        # Upper bound of the movement since the start of the path [m], by pair and state.
        pair_movements = [movements[:, pair.joints].sum(axis=1).tolist() for pair in pairs]
        # Movement up to which the bodies of each pair are farther apart than the margin [m].
        clear_until = [0.0] * len(pairs)
        # A part that starts within the margin of a body must not come closer than at the start, until the
        # distance has exceeded the margin for the first time. Every other part must keep the margin.
        start_distances: dict[tuple[str, str], float] = {}
        for index, q in enumerate(path):
            due = [i for i in range(len(pairs)) if pair_movements[i][index] >= clear_until[i]]
            if due:
                self._place_arm(q, load)
            closest: dict[tuple[str, str], ClosestApproach] = {}
            for i in due:
                distance, approaches = self._measure_distance(pairs[i])
                clear_until[i] = pair_movements[i][index] + distance - self._margin - ROUNDING_ERROR
                for approach in approaches:
                    key = approach.part, approach.body
                    pair = (closest.get(key, approach), approach)
                    closest[key] = min(pair, key=lambda each: each.distance - each.min_distance)
            if index == 0:
                start_distances = {key: approach.distance for key, approach in closest.items()}
            start_distances = {key: start_distances[key] for key in closest if key in start_distances}
            for key, approach in closest.items():
                start_distance = start_distances.get(key, math.inf) - START_TOLERANCE
                min_distance = min(approach.min_distance, start_distance)
                if approach.distance < min_distance - ROUNDING_ERROR:
                    place = format_point(self.world.get_tool_pose().position)
                    message = f"the motion would bring {approach}, with the tool at {place}; "
                    raise Blocked(f"{message}the minimum clearance is {self._margin:.3f} m")

    def find_violation(self, q: Array) -> ClosestApproach | None:
        """Return the closest approach of the unloaded arm at `q` `(n,)` [rad], or None if it is allowed."""
        self._place_arm(q, None)
        approaches = [a for pair in self._list_pairs(None, []) for a in self._measure_distance(pair)[1]]
        closest = min(approaches, key=attrgetter("distance"), default=None)
        return closest if closest and closest.distance < closest.min_distance - ROUNDING_ERROR else None

    def close(self) -> None:
        """Close the world of the check."""
        self.world.close()

    def _list_pairs(self, load: ObjectClass | None, obstacles: Sequence[tuple[str, int]]) -> list[BodyPair]:
        """Return all pairs; `obstacles` contains name and body of each obstacle."""
        world = self.world
        counts = world.joint_counts
        joints = range(len(world.joints))
        bodies = [("the table", world.table), *world.bin_bodies.items(), *obstacles]
        # A vertical joint 1 turns the first link about the axis of the base.
        first_count = 1 + world.has_vertical_axis
        touching = [link for link, count in counts.items() if count >= first_count]
        links = [link for link, count in counts.items() if count > 1]
        pairs = [BodyPair((world.arm, body), touching, joints, body_name=name) for name, body in bodies]
        for link_a, link_b in self.self_collision_pairs:
            first, last = sorted((counts[link_a], counts[link_b]))
            pair = BodyPair((world.arm, world.arm), [link_a], joints[first:last], world.name_link(link_b))
            pairs.append(pair._replace(link_pair=(link_a, link_b)))
        if load is None:
            return pairs
        load_body = self._get_load_body(load)
        name = name_load(load.label)
        for body_name, body in bodies:
            support_height = -math.inf
            if body == world.table or body_name in world.bin_bodies:
                bin = world.config.bins.get(body_name)
                support_height = (bin.position[2] if bin else 0.0) + BIN_THICKNESS + SUPPORT_TOLERANCE
            pairs.append(BodyPair((load_body, body), [-1], joints, body_name, name, support_height))
        # The load may touch the wrist.
        lower_links = [link for link in links if counts[link] <= len(joints) - WRIST_JOINT_COUNT]
        return [*pairs, BodyPair((world.arm, load_body), lower_links, joints[2:], load_name=name)]

    def _measure_distance(self, pair: BodyPair) -> tuple[float, list[ClosestApproach]]:
        """Return the distance of a pair [m], and a `ClosestApproach` for each pair of points in the margin.

        A distance beyond the margin plus `SEARCH_DISTANCE` is returned as this sum.
        """
        max_distance = self._margin + SEARCH_DISTANCE
        all_points = self._get_closest_points(*pair.bodies, max_distance, *pair.link_pair)
        all_points = [points for points in all_points if points[LINK_A] in pair.links]
        approaches = [
            ClosestApproach(
                pair.load_name or self.world.name_link(points[LINK_A]),
                pair.body_name or self.world.name_link(points[LINK_A]),
                points[DISTANCE],
                0.0 if points[POSITION_B][2] <= pair.support_height else self._margin,
            )
            for points in all_points
            if points[DISTANCE] <= self._margin
        ]
        return min((points[DISTANCE] for points in all_points), default=max_distance), approaches

    def _place_arm(self, q: Array, load: ObjectClass | None) -> None:
        """Move the arm to joint positions `(n,)` [rad], with the load under the tool."""
        world = self.world
        client = world.client
        client.resetJointStatesMultiDof(world.arm, world.joints, [[angle] for angle in q])
        if load is not None:
            flange = client.getLinkState(world.arm, world.tool_index, computeForwardKinematics=True)[4:6]
            offset = world.config.tool.length
            offset += world.config.tool.get_hold_height(load) - load.height / 2
            load_pose = client.multiplyTransforms(*flange, [0, 0, offset], [0, 0, 0, 1])
            client.resetBasePositionAndOrientation(self._get_load_body(load), *load_pose)

    def _get_load_body(self, load: ObjectClass) -> int:
        return self._get_cylinder(load.radius + load.contact_radius, load.height, 0)

    def _compute_max_radii(self) -> Array:
        """Return the maximum distance of a point of the arm from the axis of each joint `(n,)` [m]."""
        world = self.world
        client = world.client
        states = client.getLinkStates(world.arm, world.joints, computeForwardKinematics=True)
        axes = [
            client.rotateVector(state[5], client.getJointInfo(world.arm, joint)[JOINT_AXIS])
            for joint, state in zip(world.joints, states, strict=True)
        ]
        origins = np.array([*(state[4] for state in states), world.get_tool_pose().position])
        links = np.diff(origins, axis=0)
        lengths = np.linalg.norm(links, axis=1)
        # Maximum distance of a point of the links after each joint from the origin of the joint.
        sizes = np.zeros(len(lengths))
        for link, count in world.joint_counts.items():
            if count and client.getCollisionShapeData(world.arm, link):
                corners = np.array([*itertools.product(*zip(*client.getAABB(world.arm, link), strict=True))])
                size = float(np.linalg.norm(corners - origins[count - 1], axis=1).max())
                sizes[count - 1] = max(sizes[count - 1], size)
        # The link of a joint counts only with its component perpendicular to the axis of the joint.
        radii = np.linalg.norm(np.cross(axes, links), axis=1)
        paths = np.cumsum(lengths) - lengths  # from the first joint to each joint
        for joint in range(len(radii)):
            # A point of a later link is at most the path to its joint and its size away.
            later_sizes = paths[joint + 1 :] - paths[joint] - lengths[joint] + sizes[joint + 1 :]
            radii[joint] = max(sizes[joint], radii[joint] + later_sizes.max(initial=0.0))
        return radii

    def _place_obstacles(self, obstacles: Sequence[Obstacle]) -> list[tuple[str, int]]:
        """Represent the obstacles by cylinders on the table; return name and body of each obstacle."""
        if len(self._cylinders) > MAX_CYLINDER_COUNT:
            for body in self._cylinders.values():
                self.world.client.removeBody(body)
            self._cylinders.clear()
        placed_obstacles = []
        for number, obstacle in enumerate(obstacles, 1):
            body = self._get_cylinder(round(obstacle.radius, 4), round(obstacle.top, 4), number)
            position = [obstacle.x, obstacle.y, obstacle.top / 2]
            self.world.client.resetBasePositionAndOrientation(body, position, [0, 0, 0, 1])
            placed_obstacles.append((obstacle.name, body))
        return placed_obstacles

    def _get_cylinder(self, radius: float, height: float, number: int) -> int:
        """Return the body of a cylinder; `number` distinguishes cylinders of equal size."""
        key = (radius, height, number)
        if key not in self._cylinders:
            client = self.world.client
            shape = client.createCollisionShape(pybullet.GEOM_CYLINDER, radius=radius, height=height)
            self._cylinders[key] = int(client.createMultiBody(0, shape))
        return self._cylinders[key]


def find_self_collision_pairs(world: CellWorld) -> tuple[tuple[int, int], ...]:
    """Return the pairs of links that can collide with each other, by their indices.

    If the arm file names no pairs, they are the pairs of links that come near to each other in random poses.
    Neighbouring links are no pair, because their hulls mostly overlap.
    """
    arm = world.config.arm
    if arm.self_collision_pairs is not None:
        return tuple((world.find_link(a), world.find_link(b)) for a, b in arm.self_collision_pairs)
    counts = tuple(world.joint_counts.items())
    return _search_pairs(world.arm_urdf, tuple(world.joints), counts, arm.limits.position_ranges_deg)


@lru_cache(maxsize=8)
def _search_pairs(
    urdf: str,
    joints: tuple[int, ...],
    joint_counts: tuple[tuple[int, int], ...],
    ranges_deg: tuple[tuple[float, float], ...],
) -> tuple[tuple[int, int], ...]:
    """Return the pairs of links of a URDF that come near to each other in a world of their own.

    The search takes 0.05 s. `joints` and `joint_counts` are as in `CellWorld`.
    """
    client = BulletClient(pybullet.DIRECT)
    arm = load_urdf_text(client, urdf, flags=pybullet.URDF_IGNORE_VISUAL_SHAPES)
    counts = dict(joint_counts)
    links = [link for link in counts if client.getCollisionShapeData(arm, link)]
    pairs = [(a, b) for a, b in itertools.combinations(links, 2) if abs(counts[a] - counts[b]) > 1]
    near_counts = dict.fromkeys(pairs, 0)
    touch_counts = dict.fromkeys(pairs, 0)
    rng = np.random.default_rng(0)
    ranges = np.radians(ranges_deg).T
    # A revolution is enough: ±180°, or, if the middle of the range is beyond, the one about 180° or -180°.
    centres = np.trunc(ranges.mean(axis=0) / math.pi) * math.pi
    lower, upper = ranges.clip(centres - math.pi, centres + math.pi)
    for q in rng.uniform(lower, upper, (SAMPLE_COUNT, len(lower))):
        client.resetJointStatesMultiDof(arm, joints, [[angle] for angle in q])
        for pair in pairs:
            points = client.getClosestPoints(arm, arm, NEAR_DISTANCE, *pair)
            near_counts[pair] += bool(points)
            touch_counts[pair] += any(point[DISTANCE] < 0 for point in points)
    client.disconnect()
    max_touch_count = MAX_TOUCH_FRACTION * SAMPLE_COUNT
    return tuple(pair for pair in pairs if near_counts[pair] and touch_counts[pair] <= max_touch_count)
