"""Skill that transports the held item into a bin."""

from __future__ import annotations

from executive.cell.objects import Item
from executive.cell.protocols import Cell, Steps
from executive.errors import Blocked
from executive.manipulation.grasps import make_bin_goal
from executive.manipulation.motions import transport, verify_grasp
from executive.manipulation.tool_goals import DROP_HEIGHT, explain_uncertain_bin
from executive.skill import ANY, EMPTY, HOLDING, In, Metres, Skill, param, port


class Transit(Skill):
    """Transport the held item to a position above a free slot of a bin.

    The arm makes one motion: up, over all walls, and down into the bin. The accelerations are so low that the
    tool holds the item with a safety factor of two. The skill reads its sensor during the whole motion.

    At the end, the load of the tool must confirm that the tool holds the item, unless the item is too light
    or the load cell is broken. Without a load, the skill opens the tool and fails with `dropped`, or with
    `sensor_implausible` if the sensor then reports an object in free air.

    The skill fails with `blocked` if the bin depends on the weight of the item, and no weighing made the
    class of the item certain, and with `bin_missing` if images contradict the declared place or colour of
    the bin. It also fails with `blocked` if the bin has a `place_yaw_deg`, and no image showed the yaw of the
    item before the grasp, or open fingers would hit something at this yaw.
    """

    held: In[Item] = port(refers_to="item", doc="the item in the tool")
    bin: In[str] = port(refers_to="bin", doc="the bin for the item")
    drop: Metres = param(DROP_HEIGHT, ge=0.005, le=0.1, doc="height of the item's underside above the slot")
    reasons = ("unreachable", "blocked", "bin_missing", "dropped", "sensor_implausible")
    uses = ("arm", "tool")
    moves = True
    tool_state = (HOLDING, HOLDING)
    tool_state_after_failure = {"dropped": EMPTY, "sensor_implausible": EMPTY, "halt": ANY}

    def run(self, cell: Cell) -> Steps:
        """Plan the motion, and follow it while the tool holds the item."""
        if contradiction := cell.ledger.contradicted_bins.get(self.bin):
            raise self.failure("bin_missing", contradiction)
        if doubt := explain_uncertain_bin(cell, self.bin, self.held):
            raise self.failure("blocked", doubt)
        try:
            held_pose = cell.ledger.get_held_pose(self.held)
            goal = make_bin_goal(cell, self.bin, self.held, held_pose, self.drop)
        except Blocked as error:
            raise self.failure("blocked", str(error)) from error
        yield from transport(self, cell, self.held, goal, self.bin)
        yield from verify_grasp(self, cell, self.held, goal)
