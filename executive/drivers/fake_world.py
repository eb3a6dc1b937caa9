"""World of a cell without physics: objects that lie on the table or in bins, or that the tool holds."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from executive.cell.config import CellConfig
from executive.cell.devices import TrueObject
from executive.cell.objects import BIN_THICKNESS, Bin, ObjectClass
from executive.geometry import Array, Pose, rotate_about_z

MAX_GRIP_OFFSET = 0.012
"""Maximum horizontal distance between the tool and the contact points of an object for a grip [m]."""
TOUCH_DISTANCE = 0.001
"""Maximum vertical distance between the tool and the top of an object for contact [m]."""
YAW_SEED = 1
"""Last number of the seed of the yaws; the other number is the seed of the classes and positions."""
RECTANGLE = ((-1, -1), (1, -1), (1, 1), (-1, 1))
"""Corners of a rectangle, in half sides."""


@dataclass(eq=False)
class FakeWorld:
    """Objects and bins of a fake cell.

    Attributes:
        classes: Classes of the objects, by label.
        bins: The bins of the cell.
        objects: The objects, in the order in which they were added.
        removed_objects: The objects that were removed from the world, without the forgotten ones.
        forgotten_count: Number of forgotten objects.
        held_object: The object that the tool holds, or None.
        is_commanded: True if arm or tool has received a command since the last control step.
    """

    classes: Mapping[str, ObjectClass]
    bins: Collection[Bin] = ()
    objects: list[TrueObject] = field(default_factory=list)
    removed_objects: list[TrueObject] = field(default_factory=list)
    forgotten_count: int = 0
    held_object: TrueObject | None = None
    is_commanded: bool = False

    def put(self, label: str, x: float, y: float, yaw: float = 0.0) -> TrueObject:
        """Put a new object of a class on the table, with its centre at `x` and `y` [m], and return it.

        `yaw` is its rotation about the vertical axis [rad].
        """
        position = np.array([x, y, self.classes[label].height / 2])
        body = 1 + max((each.body for each in (*self.objects, *self.removed_objects)), default=-1)
        fake_object = TrueObject(label, Pose(rotate_about_z(yaw), position), body, [position.copy()])
        self.objects.append(fake_object)
        return fake_object

    def remove(self, true_object: TrueObject, *, is_counted: bool = True) -> None:
        """Remove the object with the body of `true_object`, which is not held; unless counted, forget it."""
        removed = self.objects.pop([each.body for each in self.objects].index(true_object.body))
        if is_counted:
            self.removed_objects.append(removed)
        else:
            self.forgotten_count += 1

    def release(self, *, is_dropped: bool = False) -> None:
        """Let the held object fall straight down; if it is dropped, it rolls to a free position."""
        if (fake_object := self.held_object) is None:
            return
        self.held_object = None
        fake_object.position[2] = self.classes[fake_object.label].height / 2
        fake_object.is_dropped = is_dropped
        if is_dropped:
            self._roll_to_free_position(fake_object)
        fake_object.rest_positions.append(fake_object.position.copy())

    def is_load_on_table(self) -> bool:
        """Return True if the held object touches the table."""
        held = self.held_object
        return held is not None and float(held.position[2]) <= self.classes[held.label].height / 2

    def _roll_to_free_position(self, fake_object: TrueObject) -> None:
        """Move an object off each overlapping object in turn, or from the wall of a bin into the bin."""
        radius = self.classes[fake_object.label].radius
        for obstacle in self.objects if self.find_bin(fake_object) is None else ():
            min_distance = radius + self.classes[obstacle.label].radius
            direction = fake_object.position[:2] - obstacle.position[:2]
            distance = float(np.linalg.norm(direction))
            if obstacle is not fake_object and distance < min_distance:
                direction = direction / distance if distance else np.array((1.0, 0.0))
                fake_object.position[:2] = obstacle.position[:2] + min_distance * direction
        if (bin := self.find_bin(fake_object)) is not None:
            max_offset = np.maximum(bin.size[:2] / 2 - radius, 0.0)
            offset = fake_object.position[:2] - bin.position[:2]
            fake_object.position[:2] = bin.position[:2] + np.clip(offset, -max_offset, max_offset)

    def find_bin(self, fake_object: TrueObject) -> Bin | None:
        """Return the bin that contains an object; if there is none, the bin on whose wall the object lies."""
        wall_margin = BIN_THICKNESS + self.classes[fake_object.label].radius / 2
        places = product((0.0, wall_margin), self.bins)
        return next((bin for margin, bin in places if bin.contains(fake_object.position, margin)), None)

    def compute_outline(self, fake_object: TrueObject) -> Array:
        """Return the corners `(N, 3)` [m] of the outline of an object that has a yaw, at half its height.

        The outline is a regular polygon or, for a symmetry of 1 or 2, the footprint.
        """
        object_class = self.classes[fake_object.label]
        symmetry = object_class.yaw_symmetry
        assert object_class.footprint is not None, "checked by ObjectConfig"
        if symmetry > 2:
            angles = np.linspace(0.0, math.tau, symmetry, endpoint=False)
            corners = object_class.radius * np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
        else:
            length, width = sorted(object_class.footprint, reverse=True)
            corners = np.array([(x * length / 2, y * width / 2, 0.0) for x, y in RECTANGLE])
        return fake_object.X_WO.apply(corners @ rotate_about_z(object_class.yaw_offset).T)

    def find_touched_object(
        self, tip_position: Array, get_hold_height: Callable[[ObjectClass], float]
    ) -> TrueObject | None:
        """Return the object that a tool at `tip_position` `(3,)` [m] can hold, or None.

        `get_hold_height` returns the distance from the tool centre point down to the underside of an object.
        """
        for fake_object in self.objects:
            object_class = self.classes[fake_object.label]
            underside = float(fake_object.position[2]) - object_class.height / 2
            gap = abs(underside + get_hold_height(object_class) - tip_position[2])
            if gap > TOUCH_DISTANCE or fake_object is self.held_object:
                continue
            offset = (fake_object.X_WO.rotation.T @ (tip_position - fake_object.position))[:2]
            # Images show the yaw up to the symmetry of the class.
            count = max(object_class.yaw_symmetry, 1)
            turns = [rotate_about_z(math.tau * index / count)[:2, :2] for index in range(count)]
            points = [turn @ point.position[:2] for turn in turns for point in object_class.grasp_points]
            errors = [math.dist(point, offset) for point in points]
            if min(errors or [abs(math.hypot(*offset) - object_class.contact_radius)]) <= MAX_GRIP_OFFSET:
                return fake_object
        return None


def put_random_objects(world: FakeWorld, config: CellConfig, seed: int) -> None:
    """Put objects of random classes on random grid points, as many as the cell file permits."""
    rng = np.random.default_rng(seed)
    yaw_rng = np.random.default_rng([seed, YAW_SEED])
    count = int(rng.integers(*config.table.objects, endpoint=True))
    points = list_grid_points(config)
    for index in rng.permutation(len(points))[:count]:
        x, y = points[index]
        world.put(str(rng.choice(list(config.objects))), x, y, yaw_rng.uniform(0, math.tau))


def list_grid_points(config: CellConfig) -> list[tuple[float, float]]:
    """Return the points on the table at which objects can lie beside each other [m]."""
    distance = 2 * max(object_class.radius for object_class in config.objects.values()) + config.table.gap
    sides = config.table.x, config.table.y
    xs, ys = (np.linspace(low, high, 1 + int((high - low) / distance)) for low, high in sides)
    return [(float(x), float(y)) for x in xs for y in ys]


def encode_object(fake_object: TrueObject) -> list[object]:
    """Return the arguments of `decode_object` after the number, for the log."""
    positions = (fake_object.position, *fake_object.rest_positions)
    return [fake_object.label, fake_object.is_dropped, fake_object.X_WO.quaternion, *positions]


def decode_object(
    body: int, label: object, is_dropped: object, quaternion: ArrayLike, *positions: object
) -> TrueObject:
    """Return an object from the log: `positions` are the current position and the rest positions."""
    position, *rest_positions = np.array(positions, dtype=float).reshape(-1, 3)
    return TrueObject(str(label), Pose.of(position, quaternion), body, rest_positions, bool(is_dropped))
