"""What happens to a cell in a campaign beside what any fault script can say."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from executive.cell import Request
from executive.errors import Unavailable
from executive.messages import Answer
from executive.testing.disturbances.effect import Effect, Occasion
from executive.testing.disturbances.hand import Thing
from executive.testing.disturbances.objects import ObjectDisturbed
from executive.testing.disturbances.scene import Scene

ASIDE = 0.06
"""How far an object is bumped aside [m]."""
DIRECTIONS = 8
"""Ways it may be bumped; the first that is free is taken."""
UNDER = 0.03
"""How far beside an object the tool may be and still be on it [m]."""


@dataclass(frozen=True)
class ObjectBumped(ObjectDisturbed):
    """Something bumps an object aside, to where it is free.

    Attributes:
        x, y: Where on the table it stays [m].
    """

    name: ClassVar = "object_moved"
    x: tuple[float, float]
    y: tuple[float, float]

    def deed(self, scene: Scene, thing: Thing) -> Callable[[], None] | None:
        """Return what bumps it, if there is room beside it."""
        way = self._way(scene, thing)
        return None if way is None else partial(scene.hand.move, thing, way)

    def _way(self, scene: Scene, thing: Thing) -> tuple[float, float] | None:
        radius = scene.cell.classes[thing.label].radius
        others = [
            (other.position[:2], scene.cell.classes[other.label].radius + radius)
            for other in scene.hand.things
            if other.body != thing.body
        ]
        for number in range(DIRECTIONS):
            angle = 2 * math.pi * number / DIRECTIONS
            by = np.array([math.cos(angle), math.sin(angle)]) * ASIDE
            x, y = thing.position[:2] + by
            inside = self.x[0] <= x <= self.x[1] and self.y[0] <= y <= self.y[1]
            if inside and all(math.dist((x, y), place) > apart for place, apart in others):
                return float(by[0]), float(by[1])
        return None


@dataclass(frozen=True)
class ObjectRefuses(Effect):
    """One object takes no seal, whoever tries.

    Attributes:
        number: Of the object, from 1.
    """

    name: ClassVar = "seal_fails"
    number: int

    def close(self, do: Callable[[], None], now: Occasion) -> None:
        """Close the tool in vain on that object."""
        thing = now.scene.find(self.number, "")
        here = now.scene.cell.arm.tool_pose.position
        if thing is None or math.dist(thing.position[:2], here[:2]) > UNDER:
            do()
        else:
            now.tell(thing)


@dataclass(frozen=True)
class SealBreaksOverBin(Effect):
    """The seal gives way when the object hangs over a bin that is wrong for it."""

    name: ClassVar = "seal_breaks"

    def act(self, now: Occasion) -> bool:
        """Part tool and object there."""
        scene, held = now.scene, now.scene.hand.held
        if held is None or scene.progress == 0.0:
            return False
        right = scene.cell.routes.get(held.label, ())
        bins = scene.cell.bins.items()
        if not any(name not in right and bin.contains(held.position) for name, bin in bins):
            return False
        now.tell(held)
        scene.hand.part()
        return True


@dataclass(frozen=True)
class DetectorGivenUp(Effect):
    """The detector hangs, and whoever asked it gives up at the deadline.

    Attributes:
        deadline: After the request [s].
    """

    name: ClassVar = "detector_hangs"
    deadline: float

    def request(self, ask: Callable[[], Request], now: Occasion) -> Request:
        """Ask in vain."""
        now.tell()
        ask()
        return GivenUp(now.scene, now.scene.now + self.deadline)


@dataclass(frozen=True)
class GivenUp:
    """A request whose deadline passes; implements `Request`."""

    scene: Scene
    due: float

    @property
    def ready(self) -> bool:
        """True from the deadline on."""
        return self.scene.now >= self.due

    def result(self) -> Answer:
        """Raise Unavailable."""
        raise Unavailable("the detector hangs and was given up, as the campaign wants it")
