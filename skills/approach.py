"""Skill that moves the tool down to a target, until it can grip the object."""

from __future__ import annotations

import math
from functools import partial

from executive.cell.arm import Goal, MotionGuard, Task
from executive.cell.objects import Target
from executive.cell.protocols import Cell, Steps
from executive.cell.tools import CONTACT_SPACING, OVERTRAVEL
from executive.manipulation.grasps import choose_grasp
from executive.manipulation.motions import MAX_OPENING_CHANGE, follow, plan, wait_for_fingers
from executive.manipulation.tool_goals import find_max_object_height
from executive.skill import EMPTY, In, Metres, Skill, param, port

EARLY_CONTACT_MARGIN = 0.001
"""Height above the start of the guarded descent from which a contact counts as a collision [m]."""
MAX_CONTACT_LAYERS = 4
"""Maximum height of a contact before an approach, as a multiple of the height of the tallest class."""


class Approach(Skill):
    """Move the tool to the target from above, so that it can grip the object.

    The arm makes one motion: fast to a position above the target, then a slow, guarded descent, because the
    camera does not measure the height of the surface exactly. The kind of the tool determines the grasp. A
    tool that grips the top of an object succeeds on contact near the expected height: repeated attempts touch
    different points, on a spiral or on the ring of an object with a hole, and from the fourth attempt on, the
    descent ends 5 mm above the table, to distinguish a false detection from an object.

    A gripper opens its fingers to the width of the object, moves them down on both sides of the object, and
    succeeds without a contact. It takes the fastest yaw at which its fingers hit neither neighbours nor
    walls; if there is none, the skill fails with `blocked` and names the neighbour.

    The tool may measure the object at the contact, for instance its height. A measurement may contradict the
    class of the target, unless an earlier measurement agreed with the class; the skill then fails with
    `contradicted`. A contact at which the tool cannot grip the object, for instance below its centre or more
    than `overtravel` below its top, is a miss; the skill then fails with `no_contact`. It also does at a
    contact during the fast motion, whose height cannot be measured; the next approach is slow. It fails with
    `implausible` if no pick of the run succeeds, or if the contact sensor feels something high above the
    table.
    """

    target: In[Target] = port(doc="the target to touch")
    overtravel: Metres = param(OVERTRAVEL, ge=0, le=0.03, doc="depth of the descent below the surface")
    offset: Metres = param(CONTACT_SPACING, ge=0, le=0.02, doc="spacing of the contact points of attempts")
    reasons = ("stale", "unreachable", "blocked", "contradicted", "no_contact", "implausible")
    uses = ("arm", "tool")
    moves = True
    tool_state = (EMPTY, EMPTY)

    def run(self, cell: Cell) -> Steps:
        """Move to the target, descend to the end of the guarded part, and judge the contact."""
        item = self.target.item
        tool = cell.tool
        if not cell.ledger.is_fresh(self.target):
            message = f"the robot may have moved {item} since its detection at {self.target.stamp:.2f} s"
            raise self.failure("stale", f"{message}; look again")
        find_grasp = partial(choose_grasp, cell, self.target, self.overtravel, self.offset)

        def find_goal_and_task() -> tuple[Goal, Task]:
            grasp, task = find_grasp()
            return grasp.goal, task

        motion = yield from plan(self, cell.arm, find_goal_and_task)
        grasp, _ = find_grasp()
        max_contact_height = MAX_CONTACT_LAYERS * find_max_object_height(cell)
        if tool.touching and cell.arm.tool_pose.position[2] > max_contact_height:
            raise self.failure("implausible", "the contact sensor feels something high above the table")
        # The zero of a load cell drifts; only before the descent, the tool is at rest and certainly empty.
        cell.ledger.record_empty_load(tool.load)
        first_touch_height = 0.0
        opening_time = math.inf
        if grasp.opening:
            # Fingers in a bin open in the middle of the motion, because they have no space there.
            is_in_bin = any(bin.contains(cell.arm.tool_pose.position) for bin in cell.bins.values())
            opening_time = cell.clock.now + (motion.duration / 2 if is_in_bin else 0.0)
        if opening_time <= cell.clock.now and tool.opening < grasp.opening - MAX_OPENING_CHANGE:
            # Slow fingers would otherwise come down on the object.
            tool.open(grasp.opening)
            yield from wait_for_fingers(cell)

        def record_first_touch() -> bool:
            nonlocal first_touch_height, opening_time
            if cell.clock.now >= opening_time:
                tool.open(grasp.opening)
                opening_time = math.inf
            # The border records each read of the tool pose, so the pose is read only once per contact.
            if not tool.touching:
                first_touch_height = 0.0
            elif not first_touch_height:
                first_touch_height = float(cell.arm.tool_pose.position[2])
            return False

        guard = MotionGuard(touch=grasp.guard == "touch")
        yield from follow(self, cell, motion, guard, until=record_first_touch)
        record_first_touch()
        object_class = cell.classes[self.target.label]
        height = float(cell.arm.tool_pose.position[2])
        start_height = grasp.goal.position[2] + grasp.goal.guarded_length
        slow_height = start_height - grasp.goal.fast_length + EARLY_CONTACT_MARGIN
        expectation = f"was expected at {grasp.contact_height * 1000:.0f} mm"
        if not tool.touching:
            if grasp.guard == "clear":
                return
            cell.ledger.record_failed_pick(item, found_table=grasp.proves_absence)
            message = f"no contact down to {height * 1000:.0f} mm, {item} {expectation}"
            if not cell.ledger.is_tool_plausible:
                raise self.failure("implausible", f"{message}, and no pick has succeeded; check the sensor")
            raise self.failure("no_contact", message)
        if grasp.guard == "clear" or height > start_height + EARLY_CONTACT_MARGIN:
            cell.ledger.invalidate_positions()
            message = f"the tool touched something at {height * 1000:.0f} mm on its way to {item}"
            raise self.failure("blocked", f"{message}, which {expectation}")
        if grasp.goal.fast_length and first_touch_height > slow_height:
            # The arm has braked below the contact, so `height` is no height of the object.
            cell.ledger.record_failed_pick(item)
            message = f"the tool touched something at {first_touch_height * 1000:.0f} mm, still fast; {item}"
            raise self.failure("no_contact", f"{message} {expectation}; the next approach is slow")
        measurement = cell.tool_model.measure_contact(
            object_class, self.target.position, height, cell.classes, self.overtravel
        )
        if not cell.ledger.record_measurement(item, measurement):
            raise self.failure(
                "contradicted", f"{item} may be no {object_class.label}: {measurement.contradiction}"
            )
        if measurement.is_miss:
            cell.ledger.record_failed_pick(item)
            message = f"the top of {item} {expectation}; {measurement.contradiction}"
            raise self.failure("no_contact", message)
        yield  # The control step of the contact already has a high computational load.
