"""Carry what the tool holds into a bin."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from executive.cell.objects import Item
from executive.cell.protocols import Cell, LeastTimes, Steps
from executive.manipulation.motions import carry
from executive.manipulation.tool_goals import DROP, into
from executive.skill import ANY, EMPTY, HOLDING, In, Metres, Skill, param, port


class Transit(Skill):
    """Hang the held item over a free slot of a bin, just above its floor or the layer of objects there.

    One motion: up from where it lies, across above every wall, and down inside, as gently as the
    seal needs for a safety factor of two. The tool's sensor is watched all the way.
    """

    held: In[Item] = port(refers="item", doc="the item in the tool")
    bin: In[str] = port(refers="bin", doc="where to")
    drop: Metres = param(
        DROP,
        ge=0.005,
        le=0.1,
        doc="height of the item's underside above the floor, or the layer of objects there",
    )
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
        goal = into(cell, self.bin, self.held, self.drop)
        yield from carry(self, cell, self.held, goal, self.bin)
