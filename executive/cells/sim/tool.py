"""Simulated suction tool; the contact determines the breakaway force of its seal."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import pybullet

from executive.cell.config import ToolConfig
from executive.cells.sim import command_log
from executive.cells.sim.suction import breakaway_force, measure_contact
from executive.cells.sim.world import World
from executive.geometry import Array, Pose

TOUCH_DISTANCE = 0.001
"""Largest distance from a surface at which the soft lip detects it [m]."""
LIP_LENGTH = 0.002
"""Length of the lip at the end of the tool [m]; contacts further back are contacts of the shaft."""
PULL_SMOOTHING = 0.25
"""Weight of the newest step in the low-pass filter of the pull on the seal.

The time constant is 3.5 steps or 14 ms: a seal breaks over milliseconds, while impact forces of the solver
last a single step.
"""


@dataclass
class _Grip:
    """Body at the cup: its id, its constraint, breakaway force of the seal and filtered pull on it [N]."""

    body: int
    constraint: int
    holding_force: float
    pull: Array = field(default_factory=lambda: np.zeros(3))


class SuctionTool:
    """A `Tool` on the arm of a `World`; `advance` is called after every physics step.

    A held body keeps its pose relative to the tool until the filtered pull on the seal exceeds the
    breakaway force. Moments have no effect. A broken seal forms again only after cup and object have
    separated or the vacuum was off, because right after the break the object is still within reach.

    Attributes:
        fallen: Bodies whose last seal broke; ground truth, as `held_body`.
    """

    def __init__(self, world: World, config: ToolConfig) -> None:
        self._world = world
        self._config = config
        self._vacuum = False
        self._grip: _Grip | None = None
        self._parting: int | None = None
        self._felt = (-1, False)
        self.fallen: set[int] = set()

    @property
    def touching(self) -> bool:
        """True if the lip was within 1 mm of any body after the last physics step."""
        step, felt = self._felt
        if step != self._world.steps:
            felt = any(True for _ in self._find_near(TOUCH_DISTANCE))
            self._felt = (self._world.steps, felt)
        return felt

    @property
    def holding(self) -> bool:
        """True while the vacuum indicates a held object."""
        return self._grip is not None

    @property
    def holding_force(self) -> float:
        """Breakaway force of the seal, from the vacuum gauge [N]; 0 while nothing is held."""
        return 0.0 if self._grip is None else self._grip.holding_force

    @property
    def held_body(self) -> int | None:
        """The simulator's id of the held body or None; ground truth for tests and audit, never for skills."""
        return None if self._grip is None else self._grip.body

    @property
    def pull(self) -> float:
        """Filtered pull on the seal [N], 0 while nothing is held; ground truth, as `held_body`."""
        return 0.0 if self._grip is None else float(np.linalg.norm(self._grip.pull))

    def close(self) -> None:
        """Switch the vacuum on, and hold a body within reach if its seal is strong enough."""
        self._world.log.note(command_log.CLOSE)
        self._vacuum = True
        if self._grip is None:
            self._seal()

    def open(self) -> None:
        """Release the held body and switch the vacuum off."""
        self._world.log.note(command_log.OPEN)
        self._vacuum = False
        self._parting = None
        if self._grip is not None:
            body = self._grip.body
            self._world.stood.setdefault(body, []).append(self._world.object_pose(body).position)
        self._release()

    def break_seal(self) -> None:
        """Break the seal, as too large a pull does; the held body falls."""
        self._world.log.note(command_log.PART)
        if self._grip is not None:
            self._parting = self._grip.body
            self.fallen.add(self._grip.body)
            self._release()

    def advance(self) -> None:
        """Update the seal after a physics step."""
        if self._grip is not None:
            self._check_pull(self._grip)
        elif self._vacuum:
            self._seal()

    def _check_pull(self, grip: _Grip) -> None:
        """Filter the pull on the seal, and break the seal if the pull exceeds the breakaway force."""
        force = np.array(self._world.client.getConstraintState(grip.constraint)[:3])
        grip.pull += PULL_SMOOTHING * (force - grip.pull)
        if float(np.linalg.norm(grip.pull)) > grip.holding_force:
            self.break_seal()

    def _seal(self) -> None:
        """Hold a body within reach if its seal is strong enough."""
        near = set(self._find_near(self._config.reach))
        if self._parting not in near:
            self._parting = None
        movable = near & self._world.bodies.keys() - {self._parting}
        if not movable:
            return
        world, config = self._world, self._config
        seal = measure_contact(world.client, world.tool_pose(), movable, config.cup_radius, config.reach)
        holding_force = breakaway_force(seal, config)
        if seal is not None and holding_force >= config.min_force:
            self.fallen.discard(seal.body)
            self._grip = _Grip(seal.body, self._attach(seal.body), holding_force)
            # Cup and body overlap slightly; their contact forces would act against the constraint.
            self._set_collision(seal.body, False)

    def _attach(self, body: int) -> int:
        """Fix the body to the tool at its current pose; frames of constraints lie in the centres of mass."""
        world = self._world
        X_WI = Pose.of(*world.client.getLinkState(world.arm, world.tool, computeForwardKinematics=True)[:2])
        X_IB = X_WI.inverse() @ Pose.of(*world.client.getBasePositionAndOrientation(body))
        return int(
            world.client.createConstraint(
                world.arm, world.tool, body, -1, pybullet.JOINT_FIXED, [0, 0, 0],
                X_IB.position, [0, 0, 0], X_IB.quaternion,
            )
        )  # fmt: skip

    def _release(self) -> None:
        if self._grip is None:
            return
        self._world.client.removeConstraint(self._grip.constraint)
        self._set_collision(self._grip.body, True)
        self._grip = None

    def _set_collision(self, body: int, enabled: bool) -> None:
        self._world.client.setCollisionFilterPair(self._world.arm, body, self._world.tool, -1, int(enabled))

    def _find_near(self, distance: float) -> Iterator[int]:
        """Yield every body except the arm within `distance` [m] of the lip.

        The broad phase runs first (3 us), so the call is cheap while the tool is in the air.
        """
        world = self._world
        low, high = world.client.getAABB(world.arm, world.tool)
        overlapping = world.client.getOverlappingObjects(
            [value - distance for value in low], [value + distance for value in high]
        )
        bodies = sorted({body for body, _ in overlapping or ()} - {world.arm})
        if not bodies:
            return
        X_TW = world.tool_pose().inverse()
        for body in bodies:
            points = world.client.getClosestPoints(world.arm, body, distance, linkIndexA=world.tool)
            if any(X_TW.apply(point[5])[2] > -LIP_LENGTH for point in points):
                yield body
