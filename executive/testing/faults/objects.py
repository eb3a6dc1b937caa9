"""Effects on objects: one is taken away, put elsewhere, bumped aside, or takes no seal."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from executive.errors import InputError
from executive.testing.faults.effect import Effect, Occasion, checked_share
from executive.testing.faults.hand import Thing
from executive.testing.faults.scene import Scene, Which

BUMP_DISTANCE = 0.06
"""Distance by which an object is bumped aside [m]."""
BUMP_DIRECTIONS = 8
"""Number of directions in which an object may be bumped; the first free one is taken."""
MAX_TOOL_OFFSET = 0.03
"""Horizontal distance between an object and the tool up to which the tool is on it [m]."""

Range = tuple[float, float]
"""Smallest and largest coordinate [m]."""


@dataclass(frozen=True)
class ObjectDisturbed(Effect):
    """An object is taken or put elsewhere, once; a subclass says how.

    Attributes:
        which: The object.
        share: Share of its motion that the arm must have behind it; 0 needs no motion.
    """

    which: Which
    share: float

    def change(self, scene: Scene, thing: Thing) -> Callable[[], None] | None:
        """Return what does it to an object, or None as long as it cannot be done."""
        raise NotImplementedError

    def act(self, now: Occasion) -> bool:
        """Do it, as soon as the arm is so far and there is such an object."""
        if now.scene.progress < self.share or (thing := now.scene.find(self.which, now.item)) is None:
            return False
        if (change := self.change(now.scene, thing)) is None:
            return False
        now.tell(thing)
        change()
        return True


@dataclass(frozen=True)
class ObjectRemoved(ObjectDisturbed):
    """An object is taken out of the world."""

    name = "object_removed"

    def change(self, scene: Scene, thing: Thing) -> Callable[[], None]:
        """Return what takes it away."""
        return partial(scene.hand.remove, thing)


@dataclass(frozen=True)
class ObjectMoved(ObjectDisturbed):
    """An object is put elsewhere."""

    name = "object_moved"
    by: tuple[float, float]

    def change(self, scene: Scene, thing: Thing) -> Callable[[], None]:
        """Return what moves it."""
        return partial(scene.hand.move, thing, self.by)


@dataclass(frozen=True)
class ObjectBumped(ObjectDisturbed):
    """An object is bumped aside, to a free place.

    Attributes:
        x, y: The part of the table in which it stays [m].
    """

    name = "object_moved"
    x: Range
    y: Range

    def change(self, scene: Scene, thing: Thing) -> Callable[[], None] | None:
        """Return what bumps it, if there is room beside it."""
        by = self._free_way(scene, thing)
        return None if by is None else partial(scene.hand.move, thing, by)

    def _free_way(self, scene: Scene, thing: Thing) -> tuple[float, float] | None:
        radius = scene.cell.classes[thing.label].radius
        others = [
            (other.position[:2], scene.cell.classes[other.label].radius + radius)
            for other in scene.hand.things
            if other.body != thing.body
        ]
        for number in range(BUMP_DIRECTIONS):
            angle = 2 * math.pi * number / BUMP_DIRECTIONS
            by = np.array([math.cos(angle), math.sin(angle)]) * BUMP_DISTANCE
            x, y = thing.position[:2] + by
            is_inside = self.x[0] <= x <= self.x[1] and self.y[0] <= y <= self.y[1]
            if is_inside and all(math.dist((x, y), place) > apart for place, apart in others):
                return float(by[0]), float(by[1])
        return None


@dataclass(frozen=True)
class ObjectRefuses(Effect):
    """One object takes no seal.

    Attributes:
        number: Number of the object, from 1.
    """

    name = "seal_fails"
    number: int

    def close(self, do: Callable[[], None], now: Occasion) -> None:
        """Leave the tool as it is on that object."""
        thing = now.scene.find(self.number, "")
        here = now.scene.cell.arm.tool_pose.position
        if thing is None or math.dist(thing.position[:2], here[:2]) > MAX_TOOL_OFFSET:
            do()
        else:
            now.tell(thing)


def object_removed(which: Which = "node", share: float | None = None) -> Effect:
    """Somebody takes an object away, once, out of the tool too.

    Args:
        which: The object; by default the one that the node is about.
        share: Share of its motion that the arm has then behind it, 0 to 1; by default at once.

    Raises:
        InputError: No object has such a number, or there is no such share.
    """
    return ObjectRemoved(_checked(which), checked_share(share))


def object_moved(by: tuple[float, float], which: Which = "node", share: float | None = None) -> Effect:
    """Somebody puts an object elsewhere, once.

    Args:
        by: Displacement along x and y [m]; an object that stands there is pushed aside, or flies.
        which: The object; by default the one that the node is about.
        share: Share of its motion that the arm has then behind it, 0 to 1; by default at once.

    Raises:
        InputError: No object has such a number, or there is no such share.
    """
    return ObjectMoved(_checked(which), checked_share(share), by)


def object_bumped(x: Range, y: Range, which: Which = "node", share: float | None = None) -> Effect:
    """Something bumps an object aside, once, to a free place.

    Args:
        x: The part of the table in which it stays [m].
        y: The same along y [m].
        which: The object; by default the one that the node is about.
        share: Share of its motion that the arm has then behind it, 0 to 1; by default at once.

    Raises:
        InputError: No object has such a number, or there is no such share.
    """
    return ObjectBumped(_checked(which), checked_share(share), x, y)


def object_refuses(number: int) -> Effect:
    """Nothing seals to one object.

    Args:
        number: Number of the object, from 1.
    """
    return ObjectRefuses(number)


def _checked(which: Which) -> Which:
    if isinstance(which, int) and which < 1:
        raise InputError(f"objects are counted from 1, and which is {which}")
    return which
