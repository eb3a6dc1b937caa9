"""Condition that the arm reaches a target."""

from __future__ import annotations

from executive.cell.objects import Target
from executive.cell.protocols import Cell
from executive.manipulation.tool_goals import make_object_goal
from executive.skill import In, Skill, port


class IsReachable(Skill):
    """Succeed if a joint configuration within the limits reaches the target.

    The condition ignores obstacles, so `Approach` may still fail with `blocked`.
    """

    target: In[Target] = port(doc="the target to reach")
    is_condition = True
    reasons = ("unreachable",)

    def run(self, cell: Cell) -> None:
        """Solve the inverse kinematics of the arm, without planning a motion."""
        object_class = cell.classes[self.target.label]
        goal = make_object_goal(object_class, self.target.position, cell.descent, cell.descent_speed)
        if problem := cell.arm.describe_unreachable(goal):
            raise self.failure("unreachable", f"{self.target.item}: {problem}")
