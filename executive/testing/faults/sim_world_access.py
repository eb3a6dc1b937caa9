"""Access to the world of a simulated cell, in a separate module because it imports the simulator."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from executive.cells.sim.arm import SimArm
from executive.cells.sim.cell import SimCell
from executive.cells.sim.tool import SuctionTool
from executive.geometry import Pose
from executive.testing.faults.world_access import TrueObject, WorldAccess

SETTLING_STEPS = 240
"""Number of control steps until arm and displaced objects are at rest; 1 s."""


class SimWorldAccess(WorldAccess):
    """Access to the world of a simulated cell."""

    def __init__(self, workcell: SimCell) -> None:
        arm, tool = workcell.cell.arm, workcell.cell.tool
        assert isinstance(arm, SimArm)
        assert isinstance(tool, SuctionTool)
        self._workcell, self._world = workcell, workcell._world
        self._arm, self._tool = arm, tool

    @property
    def objects(self) -> Sequence[TrueObject]:
        """All loose objects, in the order of their creation."""
        return [self._make_true_object(body) for body in self._world.labels]

    @property
    def held_object(self) -> TrueObject | None:
        """The object at the tool, or None."""
        body = self._tool.held_body
        return None if body is None else self._make_true_object(body)

    def remove(self, true_object: TrueObject) -> None:
        """Remove an object from the world."""
        self.release_if_held(true_object)
        self._world.remove_object(true_object.body)

    def move(self, true_object: TrueObject, displacement: tuple[float, float]) -> None:
        """Displace an object."""
        self.release_if_held(true_object)
        X_WO = self._world.get_object_pose(true_object.body)
        position = X_WO.position + np.array([*displacement, 0.0])
        self._world.place_object(true_object.body, Pose(X_WO.rotation, position))

    def break_seal(self) -> None:
        """Break the seal of the tool."""
        self._tool.break_seal()

    def simulate_collision(self, message: str) -> None:
        """Simulate a collision of the arm; `message` is the reported cause."""
        self._arm.stop_after_collision(message)

    def settle(self) -> None:
        """Simulate `SETTLING_STEPS` control steps between two runs."""
        self._world.is_idle = True
        for _ in range(SETTLING_STEPS):
            self._workcell.advance()
        self._world.is_idle = False

    def _make_true_object(self, body: int) -> TrueObject:
        return TrueObject(body, self._world.labels[body], self._world.get_object_pose(body).position)
