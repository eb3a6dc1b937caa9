"""Detection of collisions of the simulated arm, with the sensitivity of joint torque sensors."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from executive.cells.sim.tool import LIP_LENGTH
from executive.cells.sim.world import BODY_B, LINK_A, NORMAL_FORCE, POSITION_A, World, name_load

MIN_CONTACT_FORCE = 2.0
"""Minimum force of a detected contact [N], an assumption for joint torque sensors."""
SEPARATION_STEP_COUNT = 12
"""Number of steps without contact after which two bodies count as separated; a lifted load may bounce."""


class ContactMonitor:
    """Monitor of the contacts of arm, tool and load that begin during the running motion.

    Args:
        world: The world of the arm.
        get_held_body: Returns the body that the tool holds, or None.
    """

    def __init__(self, world: World, get_held_body: Callable[[], int | None]) -> None:
        self._world = world
        self._get_held_body = get_held_body
        self._last_contact_steps: dict[tuple[str, int], int] = {}
        """Physics step of the last contact of each ignored pair of a robot part and a body."""

    def reset(self) -> None:
        """Ignore each pair of bodies that is in contact now until the two bodies separate."""
        step = self._world.step_count
        self._last_contact_steps = {(part, body): step for part, body, _, _ in self._iterate_contacts()}

    def find_new_contact(self, lip_may_touch: bool) -> tuple[str, Sequence[float] | None]:
        """Return description and point [m] of a new forbidden contact; without one, "" and None.

        The lip is exempt if `lip_may_touch`.
        """
        now, last_steps = self._world.step_count, self._last_contact_steps
        oldest_step = now - SEPARATION_STEP_COUNT
        self._last_contact_steps = {pair: step for pair, step in last_steps.items() if step >= oldest_step}
        for part, body, position, force in self._iterate_contacts():
            if (part, body) in self._last_contact_steps:
                self._last_contact_steps[part, body] = now
            elif force > MIN_CONTACT_FORCE and not (lip_may_touch and self._is_lip(part, position)):
                x, y, z = self._world.get_tool_pose().position
                name = self._world.name_body(body)
                return f"{part} ran into {name}, with the tool at ({x:.3f}, {y:.3f}, {z:.3f}) m", position
        return "", None

    def _is_lip(self, part: str, position: Sequence[float]) -> bool:
        """Return True if a point in the world [m] on a part of the robot is on the lip of the cup."""
        X_TW = self._world.get_tool_pose().inverse()
        is_tool = part == self._world.name_link(self._world.tool_index)
        return is_tool and bool(X_TW.apply(position)[2] > -LIP_LENGTH)

    def _iterate_contacts(self) -> Iterator[tuple[str, int, Sequence[float], float]]:
        """Yield part of the robot, touched body, contact point [m] and normal force [N] of each contact."""
        world, held_body = self._world, self._get_held_body()
        robot = (world.arm,) if held_body is None else (world.arm, held_body)
        for body in robot:
            for point in world.client.getContactPoints(bodyA=body) or ():
                if point[BODY_B] not in robot:
                    is_arm = body == world.arm
                    part = world.name_link(point[LINK_A]) if is_arm else name_load(world.labels[body])
                    yield part, point[BODY_B], point[POSITION_A], point[NORMAL_FORCE]
