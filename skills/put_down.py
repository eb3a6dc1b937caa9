"""Leave what the tool holds at a safe free place."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from executive.cell.objects import Item
from executive.cell.protocols import Cell, Steps
from executive.manipulation.motions import carry, let_go
from executive.manipulation.tool_goals import aside
from executive.skill import ANY, EMPTY, HOLDING, In, Metres, Seconds, Skill, SkillFailed, param, port

LIFTED = 0.003
"""How high above the table something hangs that was lifted from it [m]."""


class PutDown(Skill):
    """Put the held item down on the cell's safe place, or beside what stands there, where a look finds it.

    What was not lifted from the table yet, and whose way is blocked, is left where it is.
    The tool's sensor is watched all the way.
    """

    held: In[Item] = port(refers="item", doc="the item in the tool")
    drop: Metres = param(0.005, ge=0, le=0.05, doc="height of the item's underside above the table")
    settle: Seconds = param(0.10, ge=0, le=2, doc="time given to the vacuum to vanish")
    reasons: ClassVar = ("unreachable", "blocked", "dropped", "stuck")
    uses: ClassVar = ("arm", "tool")
    moves: ClassVar = True
    tool_state: ClassVar = (HOLDING, EMPTY)
    tool_left: ClassVar = {"dropped": EMPTY, "halt": ANY}
    waits: ClassVar = "settle"

    def run(self, cell: Cell) -> Steps:
        """Carry it there, come down, let go."""
        goal = aside(cell, self.held, self.drop)
        height = cell.classes[cell.ledger.get_label(self.held)].height
        lying = float(cell.safe_place[2]) + height
        try:
            yield from carry(self, cell, self.held, goal, "the safe place")
        except SkillFailed as failure:
            # What was not lifted yet stands where it stood, as well as anywhere.
            if failure.reason != "blocked" or cell.arm.tool_pose.position[2] > lying + LIFTED:
                raise
        x, y, _ = cell.arm.tool_pose.position
        place = np.array((x, y, lying - height / 2))
        yield from let_go(
            self, cell, self.held, self.settle, lambda: cell.ledger.record_put_down(self.held, place)
        )
