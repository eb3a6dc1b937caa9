"""Let go of what the tool holds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from executive.cell import Cell, LeastTimes, Steps
from executive.messages import Item
from executive.moving import let_go
from executive.skill import ANY, EMPTY, HOLDING, In, Out, Seconds, Skill, param, port


class Release(Skill):
    """Let the held item fall into its bin and prove that the tool is empty."""

    held: In[Item] = port(refers="item", doc="the item in the tool")
    bin: In[str] = port(refers="bin", doc="where it is let go")
    placed: Out[Item] = port(refers="item", doc="the item in the bin")
    settle: Seconds = param(0.10, ge=0, le=2, doc="time given to the vacuum to vanish")
    reasons: ClassVar = ("stuck",)
    uses: ClassVar = ("tool",)
    tool_state: ClassVar = (HOLDING, EMPTY)
    tool_left: ClassVar = {"halt": ANY}

    @classmethod
    def shortest(cls, least: LeastTimes, given: Mapping[str, Any]) -> float:
        """Return `settle` [s]."""
        del least
        return float(given["settle"])

    def run(self, cell: Cell) -> Steps:
        """Switch the vacuum off and ask the sensor."""
        yield from let_go(self, cell, self.held, self.settle)
        cell.ledger.placed(self.held, self.bin)
        self.placed = self.held
