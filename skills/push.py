"""Skill that pushes a target away from its neighbours, so that fingers find space beside it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from executive.cell.arm import Goal, MotionGuard, Task
from executive.cell.objects import Target
from executive.cell.protocols import Cell, Steps
from executive.geometry import Array
from executive.manipulation.grasps import SAFETY_DISTANCE, explain_blocked_grasp
from executive.manipulation.motions import follow, make_task, plan, wait_for_fingers
from executive.manipulation.tool_goals import find_max_object_height, list_obstacles, make_obstacle
from executive.skill import EMPTY, In, MetresPerSecond, Newtons, Skill, SkillFailed, param, port

FINGER_OPENING = 0.005
"""Distance between the nearly closed fingers during a push [m]; 0 would stand for open fingers."""
DIRECTION_COUNT = 16
"""Number of directions that are tried."""
PUSH_LENGTHS = (0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08)
"""Lengths of pushes that are tried [m]."""
MAX_EXCESS_LENGTH = 0.015
"""Maximum distance by which an object moves farther than intended [m]: it may roll, or be wider."""
MAX_LIFT = 0.01
"""Maximum height of the underside of a pushed object above the table [m], for errors of a depth image."""
MAX_APPROACH = 0.002
"""Maximum distance by which a pushed object may come nearer to a neighbour that it touches [m]."""
MAX_ATTEMPTS = 4
"""Maximum number of pushes for which motions are planned."""


class Push(Skill):
    """Push the target by a few centimetres, away from neighbours that leave no space for the fingers.

    The nearly closed fingers move down on the free side of the object, and push it slowly along a straight
    line. The skill takes the shortest push after which the open fingers find space, within the workspace and
    not towards other objects. The arm stops at a force above `max_force`, as at a collision.

    After a push, new images must show where the objects are. The skill fails with `blocked` if there is no
    such push, or if neighbours are not the reason why the target cannot be grasped; a tool without fingers
    therefore never pushes.
    """

    target: In[Target] = port(doc="the target to push")
    speed: MetresPerSecond = param(0.05, ge=0.005, le=0.25, doc="speed of the tool during the push")
    max_force: Newtons = param(10.0, ge=2, le=100, doc="maximum force on the object")
    reasons = ("stale", "unreachable", "blocked")
    uses = ("arm", "tool")
    moves = True
    tool_state = (EMPTY, EMPTY)

    def run(self, cell: Cell) -> Steps:
        """Push the object in the direction with the shortest push for which the planner finds motions."""
        item = self.target.item
        if not cell.ledger.is_fresh(self.target):
            raise self.failure("stale", f"the robot may have moved {item} since its detection; look again")
        if not explain_blocked_grasp(cell, self.target):
            raise self.failure("blocked", f"no neighbour of {item} is in the way; a push does not help")
        if self.target.position[2] > cell.classes[self.target.label].height / 2 + MAX_LIFT:
            raise self.failure("blocked", f"{item} lies on another object, and a push would throw it down")
        failure = self.failure("blocked", f"there is no place with space for the fingers near {item}")
        pushes = []
        for number in range(DIRECTION_COUNT):
            yield  # The search in one direction takes some milliseconds.
            angle = math.tau * number / DIRECTION_COUNT
            direction = (math.cos(angle), math.sin(angle), 0.0)
            if length := self._find_length(cell, np.array(direction)):
                pushes.append((length, direction))
        for length, direction in sorted(pushes)[:MAX_ATTEMPTS]:
            try:
                yield from self._push(cell, length, direction)
                return
            except SkillFailed as error:
                failure = error
                # The tool has touched something, which may have moved the object.
                if not cell.ledger.is_fresh(self.target):
                    break
        raise failure

    def _find_length(self, cell: Cell, direction: Array) -> float:
        """Return the length [m] of the shortest permitted push along a unit vector `(3,)`; 0 if none."""
        low, high = cell.workspace
        place = self.target.position
        radius = cell.classes[self.target.label].radius
        obstacles = list_obstacles(cell, self.target.item)
        centres = np.array([(each.x, each.y) for each in obstacles]).reshape(-1, 2)
        sums_of_radii = np.array([each.radius + radius for each in obstacles])
        min_distances = np.minimum(np.linalg.norm(centres - place[:2], axis=1), sums_of_radii) - MAX_APPROACH
        for length in PUSH_LENGTHS:
            end = place + length * direction
            farthest_end = (end + MAX_EXCESS_LENGTH * direction)[:2]
            is_inside = np.all((low <= farthest_end) & (farthest_end <= high))
            if not is_inside or np.any(np.linalg.norm(centres - end[:2], axis=1) < min_distances):
                return 0.0
            if not explain_blocked_grasp(cell, replace(self.target, position=end)):
                return length
        return 0.0

    def _push(self, cell: Cell, length: float, direction: tuple[float, float, float]) -> Steps:
        """Move above the start of a push, close the fingers, move down, push, and record the new position."""
        goal = self._make_goal(cell, length, direction)
        x, y, z = goal.compute_line_start(goal.guarded_length)
        above = Goal((x, y, z + find_max_object_height(cell)), goal.yaws)
        motion = yield from plan(self, cell.arm, lambda: (above, make_task(cell)))
        yield from follow(self, cell, motion)
        cell.tool.open(FINGER_OPENING)
        yield from wait_for_fingers(cell)
        obstacle = make_obstacle(cell, self.target)
        task = Task(obstacles=list_obstacles(cell, self.target.item), target=obstacle, opening=FINGER_OPENING)
        motion = yield from plan(self, cell.arm, lambda: (goal, task))
        try:
            yield from follow(self, cell, motion, MotionGuard(push_force=self.max_force))
        finally:
            remaining_length = float((goal.position - cell.arm.tool_pose.position) @ direction)
            pushed_length = max(length - remaining_length, 0.0)
            position = self.target.position + pushed_length * np.array(direction)
            cell.ledger.record_put_down(self.target.item, position)

    def _make_goal(self, cell: Cell, length: float, direction: tuple[float, float, float]) -> Goal:
        """Return the goal of a push of a length [m] along a unit vector; its guarded part is the push."""
        object_class = cell.classes[self.target.label]
        finger_radius = max(part.radius for part in cell.tool_model.list_parts(FINGER_OPENING)[1:])
        # The object is at least as wide as its footprint, so that no push is shorter than intended.
        half_width = min(object_class.footprint or (2 * object_class.radius,)) / 2
        end_offset = length - half_width - finger_radius
        start_offset = object_class.radius + finger_radius + cell.motion.margin + SAFETY_DISTANCE
        x, y, z = map(float, self.target.position + end_offset * np.array(direction))
        height = z - object_class.height / 2 + cell.tool_model.get_hold_height(object_class)
        # The fingers close along the push, because they are narrower across it.
        yaw = math.atan2(direction[0], -direction[1])
        return Goal(
            (x, y, height), (yaw, yaw + math.pi), end_offset + start_offset, self.speed, direction=direction
        )
