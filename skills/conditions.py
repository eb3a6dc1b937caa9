"""Conditions: skills that decide in one tick, and change nothing."""

from __future__ import annotations

from typing import TypeAlias

from executive.cell.objects import Item, Target
from executive.cell.protocols import Cell
from executive.cell.tools import GraspAttempt
from executive.skill import ANY, HOLDING, In, Seconds, Skill, param, port

Plain: TypeAlias = str | int | float | bool
"""Type of the values that a mission file can contain, without lists."""


class HasCounted(Skill):
    """Check that at least a number of items are placed or rejected.

    `of_class` restricts the count to one class, `inside` to one bin. With `inside`, the count of rejected
    items is always 0.
    """

    of_class: In[str | None] = port(default=None, refers_to="class", doc="only items of this class")
    inside: In[str | None] = port(default=None, refers_to="bin", doc="only items in this bin")
    counter: str = param("placed", choices=("placed", "rejected"), doc="the state of the counted items")
    at_least: int = param(ge=1, doc="minimum number of items")
    is_condition = True
    reasons = ("too_few",)

    def run(self, cell: Cell) -> None:
        """Count the items once."""
        count = cell.ledger.count_items(self.counter, self.of_class, self.inside)
        if count < self.at_least:
            objects = f"items of class {self.of_class}" if self.of_class else "items"
            place = f" in {self.inside}" if self.inside else ""
            message = f"{count} of {self.at_least} required {objects} are {self.counter}{place}"
            raise self.failure("too_few", message)


class HasElapsed(Skill):
    """Succeed if `seconds` have passed since the start of the run."""

    seconds: Seconds = param(ge=0.01, doc="time since the start of the run")
    is_condition = True
    reasons = ("too_early",)

    def run(self, cell: Cell) -> None:
        """Compare the clock of the run with the time."""
        # 1 ns covers the rounding errors of a clock that sums control periods.
        if (now := cell.clock.now) < self.seconds - 1e-9:
            raise self.failure("too_early", f"{now:.2f} of {self.seconds:g} s have passed")


class IsEqual(Skill):
    """Check that a value, for instance a field of a variable, is equal to another value.

    The skill fails with `different` if the values are not equal.
    """

    value: In[Plain] = port(compared_with="to", doc="the value to compare, for example `$target.label`")
    to: In[Plain] = port(compared_with="value", doc="the expected value, for example `cube`")
    reasons = ("different",)
    is_condition = True

    def run(self, cell: Cell) -> None:
        """Compare the values."""
        del cell
        if self.value != self.to:
            raise self.failure("different", f"the value is {self.value}, not {self.to}")


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
