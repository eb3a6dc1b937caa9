"""Conditions: skills that decide in one tick, and change nothing."""

from __future__ import annotations

from executive.cell.objects import Item, Target
from executive.cell.protocols import Cell
from executive.cell.tools import GraspAttempt
from executive.skill import ANY, HOLDING, In, Skill, port


class IsFresh(Skill):
    """Succeed if the robot cannot have moved the target since its last detection."""

    target: In[Target] = port(doc="the target whose position is checked")
    is_condition = True
    reasons = ("stale",)

    def run(self, cell: Cell) -> None:
        """Ask the ledger for actions of the robot since the detection."""
        target = self.target
        if not cell.ledger.is_fresh(target):
            message = f"the robot may have moved {target.item} since its detection at {target.stamp:.2f} s"
            raise self.failure("stale", message)


class IsHolding(Skill):
    """Succeed if the sensor of the tool and the ledger both report an item in the tool.

    The condition changes nothing: after a failure, the ledger may still report a lost item, and the tool may
    still hold an unknown object. `ConfirmGrasp` corrects both.
    """

    is_condition = True
    reasons = ("empty",)
    senses = True
    tool_state = (ANY, HOLDING)
    tool_state_after_failure = {"empty": ANY}

    def run(self, cell: Cell) -> None:
        """Compare the sensor of the tool with the ledger."""
        item = cell.ledger.find_held_item()
        noun = cell.tool_model.noun
        if not cell.tool.holding:
            known = f", but the ledger reports {item} in the tool" if item else ""
            raise self.failure("empty", f"the sensor detects no {noun}{known}")
        if item is None:
            raise self.failure("empty", f"the sensor detects a {noun}, but the ledger knows no held item")


class IsPlaced(Skill):
    """Succeed if the item is in a bin according to the ledger."""

    item: In[Item] = port(refers_to="item", doc="the item that is checked")
    is_condition = True
    reasons = ("not_placed",)

    def run(self, cell: Cell) -> None:
        """Ask the ledger for the state of the item."""
        if cell.ledger.describe(self.item).state != "placed":
            raise self.failure("not_placed", f"{self.item} is in no bin")


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
        grasps = cell.tool_model.list_grasps(object_class, self.target, cell.motion, GraspAttempt())
        problems = [cell.arm.describe_unreachable(grasp.goal) for grasp in grasps]
        if all(problems):
            raise self.failure("unreachable", f"{self.target.item}: {problems[0]}")
