"""Carry what the tool holds into a bin."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from executive.cell import Cell, LeastTimes, Steps, Via
from executive.messages import Item
from executive.moving import follow, planned, settle, travel
from executive.skill import ANY, EMPTY, HOLDING, In, Metres, Skill, param, port


class Transit(Skill):
    """Hang the held item over a free slot of a bin, just above the floor.

    Lifts it straight up, crosses above every wall, and comes down inside. The tool's sensor is watched
    all the way.
    """

    held: In[Item] = port(refers="item", doc="the item in the tool")
    bin: In[str] = port(refers="bin", doc="where to")
    drop: Metres = param(0.015, ge=0.005, le=0.1, doc="height of the item's underside above the floor")
    reasons: ClassVar = ("unreachable", "blocked", "dropped")
    uses: ClassVar = ("arm", "tool")
    moves: ClassVar = True
    tool_state: ClassVar = (HOLDING, HOLDING)
    tool_left: ClassVar = {"dropped": EMPTY, "halt": ANY}

    @classmethod
    def shortest(cls, least: LeastTimes, given: Mapping[str, Any]) -> float:
        """Return the time of the shortest carry from the workspace to the bin, if it is known which [s]."""
        return least.carry(given.get("bin"))

    def run(self, cell: Cell) -> Steps:
        """Plan the whole way, then follow it as long as the seal holds."""
        yield from settle(cell.arm)
        bin = cell.bins[self.bin]
        kind = cell.classes[cell.ledger.label(self.held)]
        slot = cell.ledger.objects_in(self.bin)
        layer, place = divmod(slot, len(bin.slots))
        over = bin.slots[place]
        low = float(bin.position[2]) + kind.height * (1 + layer) + self.drop
        way = [*travel(cell, over), Via(np.array([*over, min(low, cell.travel_height)]))]
        motion = planned(self, lambda: cell.arm.plan(way, carrying=kind))
        yield from follow(cell.arm, motion, until=lambda: not cell.tool.holding)
        if not cell.tool.holding:
            x, y, z = cell.arm.tool_pose.position
            cell.tool.open()
            cell.ledger.dropped(self.held)
            raise self.failed(
                "dropped",
                f"the seal on {self.held} broke on the way to {self.bin}, near ({x:.2f}, {y:.2f}, {z:.2f}) m",
            )
