"""Reaching into the simulated cell; the only part of the test kit that needs the simulator."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from executive.cells.sim.arm import SimArm
from executive.cells.sim.cell import SimCell
from executive.cells.sim.tool import SuctionTool
from executive.geometry import Pose
from executive.testing.faults.hand import Thing

SETTLING = 240
"""Control steps in which the arm comes to rest and what was moved does."""


class SimHand:
    """Reaches into a simulated cell; implements `Hand`."""

    def __init__(self, workcell: SimCell) -> None:
        arm, tool = workcell.cell.arm, workcell.cell.tool
        assert isinstance(arm, SimArm)
        assert isinstance(tool, SuctionTool)
        self._workcell = workcell
        self._arm, self._tool, self._world = arm, tool, workcell._world

    @property
    def things(self) -> Sequence[Thing]:
        """Every loose object."""
        return [self._thing(body) for body in self._world.bodies]

    @property
    def held(self) -> Thing | None:
        """What hangs at the tool, or None."""
        body = self._tool.held_body
        return None if body is None else self._thing(body)

    def remove(self, thing: Thing) -> None:
        """Take an object out of the world."""
        self._loosen(thing)
        self._world.remove_object(thing.body)

    def move(self, thing: Thing, by: tuple[float, float]) -> None:
        """Put an object elsewhere."""
        self._loosen(thing)
        X_WO = self._world.object_pose(thing.body)
        position = X_WO.position + np.array([*by, 0.0])
        self._world.place_object(thing.body, Pose(X_WO.rotation, position))

    def part(self) -> None:
        """Let the seal give way."""
        self._tool.part()

    def stand_in_the_way(self, what: str) -> None:
        """Let the arm run into something."""
        self._arm.run_into(what)

    def settle(self) -> None:
        """Let a second pass that is none of the run's."""
        self._world.idle = True
        for _ in range(SETTLING):
            self._workcell.advance()
        self._world.idle = False

    def _loosen(self, thing: Thing) -> None:
        if self._tool.held_body == thing.body:
            self.part()

    def _thing(self, body: int) -> Thing:
        return Thing(body, self._world.bodies[body], self._world.object_pose(body).position)
