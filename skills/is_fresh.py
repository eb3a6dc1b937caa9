"""Condition that the position of a target is valid."""

from __future__ import annotations

from executive.cell.objects import Target
from executive.cell.protocols import Cell
from executive.skill import In, Skill, port


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
