"""Seal the tool to what it touches."""

from __future__ import annotations

from typing import ClassVar

from executive.cell.objects import Item, Target
from executive.cell.protocols import Cell, Steps
from executive.skill import EMPTY, HOLDING, In, Out, Seconds, Skill, param, port


class Grasp(Skill):
    """Close the tool on the target and prove that it holds.

    Succeeds when the tool's sensor still reports a seal after `settle`.
    """

    target: In[Target] = port(doc="what the tool touches")
    held: Out[Item] = port(refers="item", doc="the item in the tool")
    settle: Seconds = param(0.10, ge=0, le=2, doc="time allowed for the grip to settle")
    reasons: ClassVar = ("missed",)
    uses: ClassVar = ("tool",)
    tool_state: ClassVar = (EMPTY, HOLDING)
    waits: ClassVar = "settle"

    def run(self, cell: Cell) -> Steps:
        """Switch the vacuum on and ask the sensor."""
        cell.tool.close()
        sealed = False
        try:
            yield from cell.clock.sleep(self.settle)
            sealed = cell.tool.holding
        finally:
            # Whoever takes the skill away would otherwise leave in the tool what nobody knows of.
            if not sealed:
                cell.tool.open()
        if not sealed:
            cell.ledger.record_miss(self.target.item)
            raise self.failed("missed", f"no seal on {self.target.item} {self.settle:.2f} s after contact")
        cell.ledger.record_grasp(self.target.item)
        self.held = self.target.item
