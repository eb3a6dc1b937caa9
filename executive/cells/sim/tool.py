"""Simulated suction tool; the breakaway force of the seal depends on the contact."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import pybullet

from executive.cell.config import ToolConfig
from executive.cells.sim import command_log
from executive.cells.sim.suction import compute_breakaway_force, measure_contact
from executive.cells.sim.world import POSITION_A, World
from executive.geometry import Array, Pose

TOUCH_DISTANCE = 0.001
"""Maximum distance from a surface at which the soft lip detects the surface [m]."""
LIP_LENGTH = 0.002
"""Length of the lip at the end of the tool [m]. Contacts above the lip touch the shaft, and do not count."""
PULL_SMOOTHING = 0.25
"""Weight of the newest step in the low-pass filter of the pull on the seal. The time constant of 14 ms (3.5
steps) suppresses impact forces of the solver, which last a single step, and is short enough for a seal."""


@dataclass
class _Grip:
    """Grip of the tool on a body.

    Attributes:
        body: The held body.
        constraint: Constraint between tool and body.
        breakaway_force: Pull at which the seal breaks [N].
        pull: Filtered pull on the seal `(3,)` [N].
    """

    body: int
    constraint: int
    breakaway_force: float
    pull: Array = field(default_factory=lambda: np.zeros(3))


class SuctionTool:
    """The suction tool of a `World`; implements `Tool`. Call `advance` after each physics step.

    A held body keeps its pose relative to the tool until the filtered pull on the seal exceeds the breakaway
    force; moments do not break the seal. The object is still within reach immediately after a break. A
    new seal therefore forms only after the object has left the reach or the vacuum has been off.

    Args:
        world: The world with the tool.
        config: Section of the tool in the cell file.
        noise_seed: Random seed of the noise of `load`.

    Attributes:
        load_std: Standard deviation of the noise of `load` [N].
        dropped_bodies: Bodies whose last seal broke; ground truth, not for skills.
    """

    def __init__(self, world: World, config: ToolConfig, noise_seed: int = 0) -> None:
        self._world = world
        self._config = config
        self.load_std = config.load_std
        self._noise_seed = noise_seed
        self._is_vacuum_on = False
        self._grip: _Grip | None = None
        self._separating_body: int | None = None  # Body whose seal broke and that is still within reach.
        self._last_touch_check = (-1, False)
        """Number of physics steps at the last check of `touching`, and the result of the check."""
        self.dropped_bodies: set[int] = set()

    @property
    def touching(self) -> bool:
        """True if the lip was within `TOUCH_DISTANCE` of any body after the last physics step."""
        step, is_touching = self._last_touch_check
        if step != self._world.step_count:
            is_touching = any(True for _ in self._find_bodies_near(TOUCH_DISTANCE))
            self._last_touch_check = (self._world.step_count, is_touching)
        return is_touching

    @property
    def holding(self) -> bool:
        """True while the tool holds an object."""
        return self._grip is not None

    @property
    def holding_force(self) -> float:
        """Breakaway force of the seal [N]; 0 while the tool holds nothing."""
        return 0.0 if self._grip is None else self._grip.breakaway_force

    @property
    def load(self) -> float:
        """Downward force of the held body on the tool [N]: its filtered pull on the seal, plus noise."""
        force = 0.0 if self._grip is None else -float(self._grip.pull[2])
        # The noise depends only on the physics step, so that a resumed run continues with the same noise.
        random_generator = np.random.default_rng([self._noise_seed, self._world.step_count])
        return force + float(random_generator.normal(0.0, self.load_std))

    @property
    def held_body(self) -> int | None:
        """The held body, or None; ground truth for tests and audit, not for skills."""
        return None if self._grip is None else self._grip.body

    @property
    def pull(self) -> float:
        """Filtered pull on the seal [N], 0 while the tool holds nothing; ground truth, not for skills."""
        return 0.0 if self._grip is None else math.hypot(*self._grip.pull)

    def close(self) -> None:
        """Switch the vacuum on, and hold a body within reach if the seal is strong enough."""
        self._world.log.append(command_log.VACUUM_ON)
        self._is_vacuum_on = True
        if self._grip is None:
            self._try_to_seal()

    def open(self) -> None:
        """Release the held body and switch the vacuum off."""
        self._world.log.append(command_log.VACUUM_OFF)
        self._is_vacuum_on = False
        self._separating_body = None
        if self._grip is not None:
            body = self._grip.body
            self._world.rest_positions.setdefault(body, []).append(self._world.get_object_pose(body).position)
            self._release(self._grip)

    def break_seal(self) -> None:
        """Break the seal, so that the held body falls."""
        self._world.log.append(command_log.SEAL_BREAK)
        if self._grip is not None:
            self._separating_body = self._grip.body
            self.dropped_bodies.add(self._grip.body)
            self._release(self._grip)

    def advance(self) -> None:
        """Update the seal after a physics step."""
        if (grip := self._grip) is not None:
            force = np.array(self._world.client.getConstraintState(grip.constraint)[:3])
            grip.pull += PULL_SMOOTHING * (force - grip.pull)
            if self.pull > grip.breakaway_force:
                self.break_seal()
        elif self._is_vacuum_on:
            self._try_to_seal()

    def _try_to_seal(self) -> None:
        """Hold a body within reach if the seal is strong enough."""
        near_bodies = set(self._find_bodies_near(self._config.reach))
        if self._separating_body not in near_bodies:
            self._separating_body = None
        sealable_bodies = near_bodies & self._world.labels.keys() - {self._separating_body}
        if not sealable_bodies:
            return
        world, config = self._world, self._config
        X_WT = world.get_tool_pose()
        contact = measure_contact(world.client, X_WT, sealable_bodies, config.cup_radius, config.reach)
        force = compute_breakaway_force(contact, config)
        if contact is not None and force >= config.min_force:
            self.dropped_bodies.discard(contact.body)
            self._grip = _Grip(contact.body, self._attach(contact.body), force)
            # Cup and body overlap slightly, and their contact forces would act against the constraint.
            self._set_collision(contact.body, False)

    def _attach(self, body: int) -> int:
        """Fix a body to the tool at its current pose, and return the constraint."""
        world = self._world
        # The constraint connects the centres of mass of tool (frame I) and body (frame B).
        tool_state = world.client.getLinkState(world.arm, world.tool_index, computeForwardKinematics=True)
        X_IB = Pose.of(*tool_state[:2]).inverse() @ Pose.of(*world.client.getBasePositionAndOrientation(body))
        return int(
            world.client.createConstraint(
                world.arm, world.tool_index, body, -1, pybullet.JOINT_FIXED, [0, 0, 0],
                X_IB.position, [0, 0, 0], X_IB.quaternion,
            )
        )  # fmt: skip

    def _release(self, grip: _Grip) -> None:
        self._world.client.removeConstraint(grip.constraint)
        self._set_collision(grip.body, True)
        self._grip = None

    def _set_collision(self, body: int, enabled: bool) -> None:
        world = self._world
        world.client.setCollisionFilterPair(world.arm, body, world.tool_index, -1, int(enabled))

    def _find_bodies_near(self, distance: float) -> Iterator[int]:
        """Yield every body except the arm within `distance` [m] of the lip.

        A comparison of bounding boxes (3 µs) comes first, because mostly no body is near the tool.
        """
        world = self._world
        low, high = world.client.getAABB(world.arm, world.tool_index)
        low, high = [value - distance for value in low], [value + distance for value in high]
        overlaps = world.client.getOverlappingObjects(low, high) or ()
        bodies = sorted({body for body, _ in overlaps} - {world.arm})
        if not bodies:
            return
        X_TW = world.get_tool_pose().inverse()
        for body in bodies:
            points = world.client.getClosestPoints(world.arm, body, distance, linkIndexA=world.tool_index)
            if any(X_TW.apply(point[POSITION_A])[2] > -LIP_LENGTH for point in points):
                yield body
