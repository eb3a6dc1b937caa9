"""What can happen to the objects: somebody takes one away, or puts it elsewhere."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

from executive.errors import InputError
from executive.testing.disturbances.effect import Effect, Occasion
from executive.testing.disturbances.hand import Thing
from executive.testing.disturbances.scene import Scene, Which
from executive.testing.disturbances.share import checked_share


@dataclass(frozen=True)
class ObjectDisturbed(Effect, ABC):
    """Something is done to an object, once; a subclass says what.

    Attributes:
        which: Which one.
        share: How much of its motion the arm must have behind it; 0 needs no motion.
    """

    which: Which
    share: float

    @abstractmethod
    def deed(self, scene: Scene, thing: Thing) -> Callable[[], None] | None:
        """Return what does it; None as long as it cannot be done."""

    def act(self, now: Occasion) -> bool:
        """Do it, as soon as the arm is so far and there is such an object."""
        thing = now.scene.find(self.which, now.item) if now.scene.progress >= self.share else None
        do = None if thing is None else self.deed(now.scene, thing)
        if do is None:
            return False
        now.tell(thing)
        do()
        return True


@dataclass(frozen=True)
class ObjectRemoved(ObjectDisturbed):
    """An object is taken out of the world."""

    name: ClassVar = "object_removed"

    def deed(self, scene: Scene, thing: Thing) -> Callable[[], None]:
        """Return what takes it away."""
        return partial(scene.hand.remove, thing)


@dataclass(frozen=True)
class ObjectMoved(ObjectDisturbed):
    """An object is put elsewhere."""

    name: ClassVar = "object_moved"
    by: tuple[float, float]

    def deed(self, scene: Scene, thing: Thing) -> Callable[[], None]:
        """Return what moves it."""
        return partial(scene.hand.move, thing, self.by)


def object_removed(which: Which = "node", share: float | None = None) -> Effect:
    """Somebody takes an object away, once; what the tool holds, out of the tool.

    Args:
        which: Which one; by default what the node is about.
        share: How much of its motion the arm has behind it then, 0 to 1; by default at once.

    Raises:
        InputError: No object has such a number, or there is no such share.
    """
    return ObjectRemoved(_checked(which), _share(share))


def object_moved(by: tuple[float, float], which: Which = "node", share: float | None = None) -> Effect:
    """Somebody puts an object elsewhere, once.

    Args:
        by: How far along x and y [m]; what stands there already is pushed aside, or flies.
        which: Which one; by default what the node is about.
        share: How much of its motion the arm has behind it then, 0 to 1; by default at once.

    Raises:
        InputError: No object has such a number, or there is no such share.
    """
    return ObjectMoved(_checked(which), _share(share), by)


def _checked(which: Which) -> Which:
    if isinstance(which, int) and which < 1:
        raise InputError(f"objects are counted from 1, and which is {which}")
    return which


def _share(share: float | None) -> float:
    return 0.0 if share is None else checked_share(share)
