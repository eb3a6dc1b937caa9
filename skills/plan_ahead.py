"""Plan the way to the next target before the arm is free."""

from __future__ import annotations

from typing import ClassVar

from executive.cell import Cell, Steps
from executive.goals import approach
from executive.messages import Target
from executive.skill import In, Skill, port


class PlanAhead(Skill):
    """Have the approach to a target planned from where the running motion will end.

    Succeeds at once and decides nothing: an `Approach` with default params to the same target begins without
    waiting for a plan, and any other plans as if this had not been.
    """

    target: In[Target] = port(doc="where the arm will probably go next")
    reasons: ClassVar = ()

    def run(self, cell: Cell) -> Steps:
        """Ask the arm."""
        yield from ()
        cell.arm.plan_ahead(*approach(cell, self.target))
