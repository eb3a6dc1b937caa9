"""Detection of collisions of the simulated arm, with the sensitivity of joint torque sensors."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from executive.cells.sim.tool import LIP_LENGTH
from executive.cells.sim.world import World, name_held

MIN_CONTACT_FORCE = 2.0
"""Smallest force of a detected contact [N]; an assumption for joint torque sensors."""
SEPARATION_STEPS = 12
"""Steps without contact after which two bodies count as separated; a lifted load may touch again earlier."""


class Contacts:
    """Contacts of arm, tool and load that began during the motion.

    Args:
        world: The world.
        held: Returns the body at the tool, or None.
    """

    def __init__(self, world: World, held: Callable[[], int | None]) -> None:
        self._world = world
        self._held = held
        self._known: dict[tuple[str, int], int] = {}

    def reset(self) -> None:
        """Ignore the present contacts until the bodies separate."""
        self._known = {(part, body): self._world.steps for part, body, _, _ in self._contacts()}

    def find_new(self, lip_may_touch: bool) -> str | None:
        """Return the text of a new contact, or None; called once per step.

        `lip_may_touch`: True if contacts of the lip of the cup are expected.
        """
        now = self._world.steps
        self._known = {pair: step for pair, step in self._known.items() if now - step <= SEPARATION_STEPS}
        for part, body, place, force in self._contacts():
            if (part, body) in self._known:
                self._known[part, body] = now
            elif force > MIN_CONTACT_FORCE and not (lip_may_touch and self._is_lip(part, place)):
                x, y, z = self._world.tool_pose().position
                name = self._world.name_body(body)
                return f"{part} ran into {name}, with the tool at ({x:.3f}, {y:.3f}, {z:.3f}) m"
        return None

    def _is_lip(self, part: str, place: Sequence[float]) -> bool:
        """Return True if a point in the world [m] on a part of the robot is on the lip of the cup."""
        return bool(part == "the tool" and self._world.tool_pose().inverse().apply(place)[2] > -LIP_LENGTH)

    def _contacts(self) -> Iterator[tuple[str, int, Sequence[float], float]]:
        """Yield part of the robot, touched body, contact point [m] and normal force [N] of each contact."""
        world, held = self._world, self._held()
        for point in world.client.getContactPoints(bodyA=world.arm) or ():
            if point[2] != held:
                yield world.name_link(point[3]), point[2], point[5], point[9]
        if held is not None:
            for point in world.client.getContactPoints(bodyA=held) or ():
                if point[2] != world.arm:
                    yield name_held(world.bodies[held]), point[2], point[5], point[9]
