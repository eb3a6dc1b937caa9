"""Skill that puts the held item down on a free position of the table."""

from __future__ import annotations

from functools import partial

import numpy as np

from executive.cell.objects import Item
from executive.cell.protocols import Cell, Steps
from executive.manipulation.motions import release, transport
from executive.manipulation.tool_goals import make_put_down_goal
from executive.skill import ANY, EMPTY, HOLDING, In, Metres, Seconds, Skill, SkillFailed, param, port

MIN_LIFT_HEIGHT = 0.003
"""Minimum height of the underside of a lifted item above the table [m]."""


class PutDown(Skill):
    """Put the held item down at the safe place of the cell, or at the nearest free position.

    The motion ends with a slow descent, which the contact of the item with the table stops. If the motion is
    blocked before the item is lifted, the skill releases the item at its position. The skill reads the sensor
    of the tool during the whole motion.
    """

    held: In[Item] = port(refers_to="item", doc="the item in the tool")
    drop: Metres = param(0.005, ge=0, le=0.05, doc="height above the table where the slow descent starts")
    settle: Seconds = param(0.10, ge=0, le=2, doc="time to wait before reading the sensor")
    reasons = ("unreachable", "blocked", "dropped", "stuck")
    uses = ("arm", "tool")
    moves = True
    tool_state = (HOLDING, EMPTY)
    tool_state_after_failure = {"dropped": EMPTY, "halt": ANY}
    waits = "settle"

    def run(self, cell: Cell) -> Steps:
        """Transport the item to a free position, and release the item."""
        item = self.held
        object_class = cell.classes[cell.ledger.get_label(item)]
        goal = make_put_down_goal(cell, object_class, self.drop, item)
        table_height = float(cell.safe_place[2])
        lying_height = table_height + cell.tool_model.get_hold_height(object_class)
        try:
            yield from transport(self, cell, item, goal, "the safe place")
        except SkillFailed as failure:
            # An item that still lies on the table is released there.
            if failure.reason != "blocked" or cell.arm.tool_pose.position[2] > lying_height + MIN_LIFT_HEIGHT:
                raise
        x, y, _ = cell.arm.tool_pose.position
        centre = np.array((x, y, table_height + object_class.height / 2))
        record_put_down = partial(cell.ledger.record_put_down, item, centre)
        yield from release(self, cell, item, self.settle, record_put_down, falls=False)
