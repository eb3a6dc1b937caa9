"""Skill that touches a place where images show something that no item explains."""

from __future__ import annotations

import math

from executive.cell.arm import Goal, MotionGuard, Task
from executive.cell.objects import Obstacle
from executive.cell.protocols import Cell, Steps
from executive.manipulation.motions import follow, plan
from executive.manipulation.tool_goals import find_max_object_height, list_obstacles
from executive.skill import EMPTY, Metres, Skill, param

PROBE_RADIUS = 0.05
"""Radius around the probed place within which the tool may touch something [m]."""


class Probe(Skill):
    """Touch the place of an unexplained region, which images show and no item explains.

    A contact proves an object: the region stays unexplained, and the result states its height. Without a
    contact, the region is flat, for instance a stain, and later looks ignore it. The skill succeeds without a
    motion if `allowed` is false, or if no region waits for a probe.
    """

    allowed: bool = param(True, doc="false: never move")
    clearance: Metres = param(0.005, ge=0.002, le=0.05, doc="height above the table at which the probe ends")
    reasons = ("unreachable", "blocked")
    uses = ("arm", "tool")
    moves = True
    tool_state = (EMPTY, EMPTY)

    def run(self, cell: Cell) -> Steps:
        """Move down to the place, stop at a contact, and record the result."""
        place = cell.ledger.choose_place_to_probe() if self.allowed else None
        if place is None:
            return
        x, y, _ = map(float, place)
        height = find_max_object_height(cell)
        goal = Goal((x, y, self.clearance), guarded_length=height, guarded_speed=cell.motion.descent_speed)
        region = Obstacle(x, y, PROBE_RADIUS, height, "the unexplained region")
        obstacles = [each for each in list_obstacles(cell) if math.dist((each.x, each.y), (x, y)) > 1e-6]
        task = Task(obstacles=tuple(obstacles), target=region)
        motion = yield from plan(self, cell.arm, lambda: (goal, task))
        yield from follow(self, cell, motion, MotionGuard(touch=True))
        touch_height = float(cell.arm.tool_pose.position[2]) if cell.tool.touching else None
        cell.ledger.record_probe(place, touch_height)
