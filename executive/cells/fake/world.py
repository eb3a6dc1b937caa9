"""World without physics: a table with objects, and the tool that picks and releases them."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field

import numpy as np

from executive.cell.bins import BIN_THICKNESS, Bin
from executive.cell.config import CellConfig
from executive.cell.objects import ObjectClass
from executive.geometry import GRAVITY, Array

MAX_SEAL_OFFSET = 0.012
"""Maximum horizontal distance between the cup and the sealing ring of an object for a seal [m]."""

TOUCH_DISTANCE = 0.002
"""Maximum vertical distance between the cup and the top of an object for contact [m]."""

DEFAULT_BREAKAWAY_FORCE = 7.9
"""Breakaway force of the seals of the fake tool, unless a test changes it [N]."""

LOAD_NOISE = 1e-9
"""Amplitude of the noise of the load of the fake tool [N], so that the load cell does not seem broken."""


@dataclass(eq=False)
class FakeObject:
    """One object of a fake world.

    Attributes:
        label: Class of the object.
        position: Centre of the object `(3,)` [m].
        rest_positions: Positions `(3,)` [m] at the start, and after each fall and each placement.
        is_dropped: True if the object fell from the tool and has not been picked up since.
    """

    label: str
    position: Array
    rest_positions: list[Array]
    is_dropped: bool = False


@dataclass(eq=False)
class FakeWorld:
    """Objects and bins of a fake cell.

    Attributes:
        classes: Classes of the objects, by label.
        bins: The bins of the cell.
        objects: The objects, in the order in which they were added.
        removed_objects: The objects that were removed from the world.
        held_object: The object that the tool holds, or None.
        is_commanded: True if arm or tool has received a command since the last control step.
    """

    classes: Mapping[str, ObjectClass]
    bins: Collection[Bin] = ()
    objects: list[FakeObject] = field(default_factory=list)
    removed_objects: list[FakeObject] = field(default_factory=list)
    held_object: FakeObject | None = None
    is_commanded: bool = False

    def put(self, label: str, x: float, y: float) -> FakeObject:
        """Put a new object on the table, and return it.

        Args:
            label: Class of the object.
            x: Position of the centre along x [m].
            y: Position of the centre along y [m].
        """
        position = np.array([x, y, self.classes[label].height / 2])
        fake_object = FakeObject(label, position, [position.copy()])
        self.objects.append(fake_object)
        return fake_object

    def remove(self, fake_object: FakeObject) -> None:
        """Remove an object that is not held."""
        self.objects.remove(fake_object)
        self.removed_objects.append(fake_object)

    def release(self, *, is_dropped: bool = False) -> None:
        """Let the held object fall straight down; if it is dropped, it rolls to a free position."""
        fake_object = self.held_object
        if fake_object is None:
            return
        self.held_object = None
        fake_object.position[2] = self.classes[fake_object.label].height / 2
        fake_object.is_dropped = is_dropped
        if is_dropped:
            self._roll_to_free_position(fake_object)
        fake_object.rest_positions.append(fake_object.position.copy())

    def _roll_to_free_position(self, fake_object: FakeObject) -> None:
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

    def find_bin(self, fake_object: FakeObject) -> Bin | None:
        """Return the bin that contains an object; if there is none, the bin on whose wall the object lies."""
        wall_margin = BIN_THICKNESS + self.classes[fake_object.label].radius / 2
        margins_and_bins = itertools.product((0.0, wall_margin), self.bins)
        position = fake_object.position
        return next((bin for margin, bin in margins_and_bins if bin.contains(position, margin)), None)

    def find_touched_object(self, tip_position: Array) -> FakeObject | None:
        """Return the object that a cup at `tip_position` `(3,)` [m] touches from above, or None."""
        for fake_object in self.objects:
            object_class = self.classes[fake_object.label]
            distance = float(np.linalg.norm(fake_object.position[:2] - tip_position[:2]))
            seal_offset = abs(distance - object_class.contact_radius)
            gap = abs(float(fake_object.position[2]) + object_class.height / 2 - tip_position[2])
            is_touched = seal_offset <= MAX_SEAL_OFFSET and gap <= TOUCH_DISTANCE
            if is_touched and fake_object is not self.held_object:
                return fake_object
        return None


class FakeTool:
    """A suction cup that seals on every touched object, unless `can_seal` returns False.

    Args:
        world: The world with the objects.
        get_tip_position: Returns the position of the tool tip `(3,)` [m].
        load_std: Declared standard deviation of a reading of `load` [N].

    Attributes:
        can_seal: Function that returns True if the cup can seal on the touched object; set by tests.
        breakaway_force: Force that every seal withstands [N].
        load_error: Error of `load` [N]; set by tests.
    """

    def __init__(self, world: FakeWorld, get_tip_position: Callable[[], Array], load_std: float) -> None:
        self._world = world
        self._get_tip_position = get_tip_position
        self.load_std = load_std
        self.load_error = 0.0
        self._noise = LOAD_NOISE
        self.can_seal: Callable[[], bool] = lambda: True
        self.breakaway_force = DEFAULT_BREAKAWAY_FORCE

    @property
    def touching(self) -> bool:
        """True while the cup touches an object or the table."""
        tip_position = self._get_tip_position()
        return self._world.find_touched_object(tip_position) is not None or float(tip_position[2]) <= 0.0

    @property
    def holding(self) -> bool:
        """True while the tool holds an object."""
        return self._world.held_object is not None

    @property
    def holding_force(self) -> float:
        """Breakaway force of the seal [N]; 0 while the tool holds nothing."""
        return self.breakaway_force if self.holding else 0.0

    @property
    def load(self) -> float:
        """Weight of the held object by the mass of its class, plus `load_error` and alternating noise [N]."""
        self._noise = -self._noise
        held = self._world.held_object
        force = self._world.classes[held.label].mass * GRAVITY if held else 0.0
        return force + self.load_error + self._noise

    def close(self) -> None:
        """Seal the cup on the touched object."""
        self._world.is_commanded = True
        fake_object = self._world.find_touched_object(self._get_tip_position())
        if fake_object is not None and self.can_seal():
            fake_object.is_dropped = False
            self._world.held_object = fake_object

    def open(self) -> None:
        """Release the held object; it falls straight down."""
        self._world.is_commanded = True
        self._world.release()

    def break_seal(self) -> None:
        """Break the seal: the held object falls straight down, and rolls off other objects and bin walls."""
        self._world.release(is_dropped=True)


def put_random_objects(world: FakeWorld, config: CellConfig, seed: int) -> None:
    """Put objects of random classes on random grid points; the cell file limits the number of objects."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(*config.table.objects, endpoint=True))
    points = list_grid_points(config)
    for index in rng.permutation(len(points))[:count]:
        world.put(str(rng.choice(list(config.objects))), *points[index])


def list_grid_points(config: CellConfig) -> list[tuple[float, float]]:
    """Return the points on the table at which objects can lie beside each other [m]."""
    distance = 2 * max(object_class.radius for object_class in config.objects.values()) + config.table.gap
    ranges = config.table.x, config.table.y
    xs, ys = (np.linspace(low, high, 1 + int((high - low) / distance)) for low, high in ranges)
    return [(float(x), float(y)) for x in xs for y in ys]
