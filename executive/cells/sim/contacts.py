"""What the simulated arm runs into, as an arm with torque sensors feels it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from executive.cells.sim.tool import LIP_LENGTH
from executive.cells.sim.world import World, held_part

MIN_CONTACT_FORCE = 2.0
"""Force from which a new contact is felt [N]: assumed of joint torque sensors; a graze is not felt."""
SEPARATION_STEPS = 12
"""Steps without touching after which two bodies have parted: a load that is lifted may graze once more."""


class Contacts:
    """Tells what arm, tool and load touch that they did not touch all the time since a motion began.

    Args:
        world: The world.
        held: Returns the body that hangs at the tool, or None.
    """

    def __init__(self, world: World, held: Callable[[], int | None]) -> None:
        self._world = world
        self._held = held
        self._known: dict[tuple[str, int], int] = {}

    def begin(self) -> None:
        """Take what touches now as known."""
        self._known = {(part, body): self._world.steps for part, body, _, _ in self._touching()}

    def new(self, feeling: bool) -> str | None:
        """Return what touches what and did not before, or None; called once a step.

        `feeling`: the tool's lip is meant to touch something now.
        """
        now = self._world.steps
        self._known = {pair: step for pair, step in self._known.items() if now - step <= SEPARATION_STEPS}
        for part, body, place, force in self._touching():
            if (part, body) in self._known:
                self._known[part, body] = now
            elif force > MIN_CONTACT_FORCE and not (feeling and part == "the tool" and self._is_lip(place)):
                x, y, z = self._world.tool_pose().position
                name = self._world.name_of(body)
                return f"{part} ran into {name}, with the tool at ({x:.3f}, {y:.3f}, {z:.3f}) m"
        return None

    def _is_lip(self, place: Sequence[float]) -> bool:
        """Tell whether a place of the tool [m] belongs to its lip."""
        return bool(self._world.tool_pose().inverse().apply(place)[2] > -LIP_LENGTH)

    def _touching(self) -> Iterator[tuple[str, int, Sequence[float], float]]:
        """Yield what touches which body, where on it [m], and how hard [N]."""
        world, held = self._world, self._held()
        for point in world.client.getContactPoints(bodyA=world.arm) or ():
            if point[2] != held:
                yield world.part_of(point[3]), point[2], point[5], point[9]
        if held is not None:
            for point in world.client.getContactPoints(bodyA=held) or ():
                if point[2] != world.arm:
                    yield held_part(world.bodies[held]), point[2], point[5], point[9]
