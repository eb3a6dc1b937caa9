"""Skill that moves the tool down to a target until contact."""

from __future__ import annotations

import math
from functools import partial

from executive.cell.arm import Goal, Guard
from executive.cell.objects import ObjectClass, Target
from executive.cell.protocols import Cell, Steps
from executive.manipulation.motions import follow, plan
from executive.manipulation.tool_goals import (
    OVERTRAVEL,
    PROBE_CLEARANCE,
    SPIRAL_SPACING,
    compute_min_contact_height,
    make_approach,
)
from executive.perception.evidence import describe_touch_contradiction, may_have_missed_top
from executive.skill import EMPTY, In, Metres, Skill, param, port

EARLY_CONTACT_MARGIN = 0.001
"""Height above the start of the guarded descent from which a contact counts as a collision [m]."""


class Approach(Skill):
    """Touch the target with the cup from above.

    The arm makes one motion: fast to a position above the target, then a slow, guarded descent, because the
    camera does not measure the height of the surface exactly. The skill succeeds on contact near the expected
    height. Repeated attempts touch different points of the target: on a spiral, or on the ring of an object
    with a hole. From the fourth attempt on, the descent ends 5 mm above the table, to distinguish a false
    detection from an object.

    A touch at a wrong height contradicts the class of the target, unless an earlier touch matched the class;
    the skill then fails with `contradicted`. The first touch that is too low is no contradiction if the
    detections alone prove the class and no class has this height. A touch at a wrong height that is no
    contradiction is a miss below the centre of the object, or more than `overtravel` below its top; the skill
    then fails with `no_contact`.
    """

    target: In[Target] = port(doc="the target to touch")
    overtravel: Metres = param(OVERTRAVEL, ge=0, le=0.03, doc="depth of the descent below the surface")
    offset: Metres = param(SPIRAL_SPACING, ge=0, le=0.02, doc="spacing of the points on the spiral")
    reasons = ("stale", "unreachable", "blocked", "contradicted", "no_contact")
    uses = ("arm", "tool")
    moves = True
    tool_state = (EMPTY, EMPTY)

    def run(self, cell: Cell) -> Steps:
        """Move to the target and descend until the cup touches something."""
        item = self.target.item
        tool = cell.tool
        if not cell.ledger.is_fresh(self.target):
            message = f"the robot may have moved {item} since its detection at {self.target.stamp:.2f} s"
            raise self.failure("stale", f"{message}; look again")
        find_goal_and_task = partial(make_approach, cell, self.target, self.overtravel, self.offset)
        motion = yield from plan(self, cell.arm, find_goal_and_task)
        goal, _ = find_goal_and_task()
        # The zero of a load cell drifts; only before the descent, the tool is at rest and certainly empty.
        cell.ledger.record_empty_load(tool.load)
        yield from follow(self, cell, motion, Guard(touch=True))
        label = self.target.label
        object_class = cell.classes[label]
        centre_height = float(self.target.position[2])
        height = float(cell.arm.tool_pose.position[2])
        start_height = goal.position[2] + goal.guarded_length
        expectation = f"was expected at {(start_height - cell.descent) * 1000:.0f} mm"
        if not tool.touching:
            cell.ledger.record_failed_pick(item, found_table=_proves_absence(goal, self.target, object_class))
            message = f"no contact down to {height * 1000:.0f} mm, {item} {expectation}"
            raise self.failure("no_contact", message)
        if height > start_height + EARLY_CONTACT_MARGIN:
            cell.ledger.invalidate_positions()
            message = f"the tool touched something at {height * 1000:.0f} mm on its way to {item}"
            raise self.failure("blocked", f"{message}, which {expectation}")
        contradiction = describe_touch_contradiction(label, height, cell.classes)
        is_near_top = height >= compute_min_contact_height(object_class, centre_height, self.overtravel)
        is_top_missed = is_near_top and may_have_missed_top(label, height, cell.classes)
        if not cell.ledger.record_touch(item, contradiction, may_have_missed_top=is_top_missed):
            raise self.failure("contradicted", f"{item} may be no {label}: {contradiction}")
        if contradiction and not is_near_top:
            cell.ledger.record_failed_pick(item)
            raise self.failure("no_contact", f"the top of {item} {expectation}; {contradiction}")
        yield  # The control step of the contact already has a high computational load.


def _proves_absence(goal: Goal, target: Target, object_class: ObjectClass) -> bool:
    """Return True if a descent to `goal` without contact proves that there is no object at the target.

    The descent must end near the table, below the centre of the object, and within half of its radius.
    """
    x, y, z = goal.position
    is_central = math.dist((x, y), target.position[:2]) <= object_class.radius / 2
    return is_central and z < target.position[2] and z <= 2 * PROBE_CLEARANCE
