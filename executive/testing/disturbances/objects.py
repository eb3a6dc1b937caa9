"""What can happen to the objects: somebody takes one away, or puts it elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from executive.errors import InputError
from executive.testing.disturbances.effect import Effect, Occasion
from executive.testing.disturbances.scene import Which


@dataclass(frozen=True)
class ObjectRemoved(Effect):
    """An object is taken out of the world."""

    name: ClassVar = "object_removed"
    which: Which

    def act(self, now: Occasion) -> bool:
        """Take it away as soon as there is such an object."""
        thing = now.scene.find(self.which, now.item)
        if thing is None:
            return False
        now.tell(thing)
        now.scene.hand.remove(thing)
        return True


@dataclass(frozen=True)
class ObjectMoved(Effect):
    """An object is put elsewhere."""

    name: ClassVar = "object_moved"
    by: tuple[float, float]
    which: Which

    def act(self, now: Occasion) -> bool:
        """Move it as soon as there is such an object."""
        thing = now.scene.find(self.which, now.item)
        if thing is None:
            return False
        now.tell(thing)
        now.scene.hand.move(thing, self.by)
        return True


def object_removed(which: Which = "node") -> Effect:
    """Somebody takes an object away, once; what the tool holds, out of the tool.

    Args:
        which: Which one; by default what the node is about.

    Raises:
        InputError: No object has such a number.
    """
    return ObjectRemoved(_checked(which))


def object_moved(by: tuple[float, float], which: Which = "node") -> Effect:
    """Somebody puts an object elsewhere, once.

    Args:
        by: How far along x and y [m]; what stands there already is pushed aside, or flies.
        which: Which one; by default what the node is about.

    Raises:
        InputError: No object has such a number.
    """
    return ObjectMoved(by, _checked(which))


def _checked(which: Which) -> Which:
    if isinstance(which, int) and which < 1:
        raise InputError(f"objects are counted from 1, and which is {which}")
    return which
