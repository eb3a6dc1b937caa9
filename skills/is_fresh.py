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
        if not cell.ledger.is_fresh(self.target):
            item, stamp = self.target.item, self.target.stamp
            raise self.failure(
                "stale", f"the robot may have moved {item} since its detection at {stamp:.2f} s"
            )
