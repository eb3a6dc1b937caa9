"""What the simulated arm runs into, as an arm with torque sensors feels it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from executive.sim.tool import LIP
from executive.sim.world import World

PRESSING = 0.01
"""Force from which a contact is felt [N]; two bodies that only graze each other have none."""


class Contacts:
    """Tells what arm, tool and load touch that they did not touch before.

    Args:
        world: The world.
        held: Returns the body that hangs at the tool, or None.
    """

    def __init__(self, world: World, held: Callable[[], int | None]) -> None:
        self._world = world
        self._held = held
        self._known: set[int] = set()
        self._feeling = False

    def begin(self, feeling: bool) -> None:
        """Take what is touched now as known; `feeling`: the tool's lip is meant to touch something."""
        self._feeling = feeling
        self._known = {body for _, body, _ in self._touching()}

    def new(self) -> str | None:
        """Return what touches what for the first time since `begin`, or None."""
        for part, body, place in self._touching():
            if body not in self._known and not (self._feeling and part == "the tool" and self._is_lip(place)):
                x, y, z = self._world.tool_pose().position
                name = self._world.name_of(body)
                return f"{part} ran into {name}, with the tool at ({x:.3f}, {y:.3f}, {z:.3f}) m"
        return None

    def _is_lip(self, place: Sequence[float]) -> bool:
        """Tell whether a place of the tool [m] belongs to its lip."""
        return bool(self._world.tool_pose().inverse().apply(place)[2] > -LIP)

    def _touching(self) -> Iterator[tuple[str, int, Sequence[float]]]:
        """Yield what touches which body, and where on it [m]."""
        world, held = self._world, self._held()
        for point in world.client.getContactPoints(bodyA=world.arm) or ():
            if point[9] > PRESSING and point[2] != held:
                yield "the tool" if point[3] == world.tool else f"link {point[3] + 1}", point[2], point[5]
        if held is not None:
            for point in world.client.getContactPoints(bodyA=held) or ():
                if point[9] > PRESSING and point[2] != world.arm:
                    yield f"the held {world.bodies[held]}", point[2], point[5]
