"""The suction tool in simulation: it holds by a seal whose strength the contact decides."""

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
"""Distance at which the soft lip already feels a surface [m]."""
LIP_LENGTH = 0.002
"""Length of the tool's end that is lip: contact further back is the shaft's [m]."""
PULL_SMOOTHING = 0.25
"""Weight of the newest step in the pull on the seal.

A time constant of 3.5 steps or 14 ms: a seal gives way over milliseconds, while the solver's impact
forces last a single step.
"""


@dataclass
class _Grip:
    """Something sealed to the cup: its body, the constraint, the pull it bears and the pull on it [N]."""

    body: int
    constraint: int
    bears: float
    pull: Array = field(default_factory=lambda: np.zeros(3))


class SuctionTool:
    """A `Tool` on the arm of a `World`; whoever steps the world calls `advance` after every step.

    What is sealed on keeps the pose it had at contact, until the low-passed pull on the seal exceeds
    its breakaway force. Moments count for nothing. A seal that has given way forms again only after
    cup and object have parted or the vacuum was off: the object is still within reach at that moment,
    but moving away.

    Attributes:
        fallen: Bodies whose last seal gave way: the truth, as `held_body`.
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
        """True while the lip is within 1 mm of anything, as of the last physics step."""
        step, felt = self._felt
        if step != self._world.steps:
            felt = any(True for _ in self._near(TOUCH_DISTANCE))
            self._felt = (self._world.steps, felt)
        return felt

    @property
    def holding(self) -> bool:
        """True while the vacuum says that something is sealed to the cup."""
        return self._grip is not None

    @property
    def bears(self) -> float:
        """The pull that the seal bears, as the vacuum gauge tells [N]; 0 while nothing is held."""
        return 0.0 if self._grip is None else self._grip.bears

    @property
    def held_body(self) -> int | None:
        """The simulator's id of what is held: the truth, for tests and the audit, never for skills."""
        return None if self._grip is None else self._grip.body

    @property
    def pull(self) -> float:
        """The low-passed pull on the seal [N], 0 when nothing is held; the truth, as `held_body`."""
        return 0.0 if self._grip is None else float(np.linalg.norm(self._grip.pull))

    def close(self) -> None:
        """Switch the vacuum on: what is within reach is sealed on if the seal bears enough."""
        self._world.log.note(command_log.CLOSE)
        self._vacuum = True
        if self._grip is None:
            self._seal()

    def open(self) -> None:
        """Let go and switch the vacuum off."""
        self._world.log.note(command_log.OPEN)
        self._vacuum = False
        self._parting = None
        if self._grip is not None:
            body = self._grip.body
            self._world.stood.setdefault(body, []).append(self._world.object_pose(body).position)
        self._let_go()

    def part(self) -> None:
        """Let the seal give way, as it does under too much pull; what hung there falls."""
        self._world.log.note(command_log.PART)
        if self._grip is not None:
            self._parting = self._grip.body
            self.fallen.add(self._grip.body)
            self._let_go()

    def advance(self) -> None:
        """Bring the seal up to date with the physics step just made."""
        if self._grip is not None:
            self._bear(self._grip)
        elif self._vacuum:
            self._seal()

    def _bear(self, grip: _Grip) -> None:
        """Low-pass the pull on the seal, and part when it is more than the seal bears."""
        force = np.array(self._world.client.getConstraintState(grip.constraint)[:3])
        grip.pull += PULL_SMOOTHING * (force - grip.pull)
        if float(np.linalg.norm(grip.pull)) > grip.bears:
            self.part()

    def _seal(self) -> None:
        """Seal the cup to what is within reach, if anything is and the seal bears enough."""
        near = set(self._near(self._config.reach))
        if self._parting not in near:
            self._parting = None
        movable = near & self._world.bodies.keys() - {self._parting}
        if not movable:
            return
        world, config = self._world, self._config
        seal = measure_contact(world.client, world.tool_pose(), movable, config.cup_radius, config.reach)
        bears = breakaway_force(seal, config)
        if seal is not None and bears >= config.least_force:
            self.fallen.discard(seal.body)
            self._grip = _Grip(seal.body, self._attach(seal.body), bears)
            # Held a hair's breadth inside the cup, the pair would push against the constraint.
            self._collide(seal.body, False)

    def _attach(self, body: int) -> int:
        """Fix the body to the tool where it is; the frames of a constraint are those of the CoMs."""
        world = self._world
        X_WI = Pose.of(*world.client.getLinkState(world.arm, world.tool, computeForwardKinematics=True)[:2])
        X_IB = X_WI.inverse() @ Pose.of(*world.client.getBasePositionAndOrientation(body))
        return int(
            world.client.createConstraint(
                world.arm, world.tool, body, -1, pybullet.JOINT_FIXED, [0, 0, 0],
                X_IB.position, [0, 0, 0], X_IB.quaternion,
            )
        )  # fmt: skip

    def _let_go(self) -> None:
        if self._grip is None:
            return
        self._world.client.removeConstraint(self._grip.constraint)
        self._collide(self._grip.body, True)
        self._grip = None

    def _collide(self, body: int, enabled: bool) -> None:
        self._world.client.setCollisionFilterPair(self._world.arm, body, self._world.tool, -1, int(enabled))

    def _near(self, distance: float) -> Iterator[int]:
        """Yield every body but the arm that is within `distance` [m] of the lip.

        The broad phase answers first (3 us), so a tool in the air costs next to nothing.
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
