"""Ask the tool's sensor."""

from __future__ import annotations

from typing import ClassVar

from executive.cell.objects import Item
from executive.cell.protocols import Cell
from executive.skill import ANY, EMPTY, HOLDING, Out, Skill, port


class IsHolding(Skill):
    """Know whether the tool holds something, and what.

    The sensor decides, whatever was believed before: an item that should be in the tool and is not has been
    dropped. After a timeout or a failure in mid-carry this tells which way to go on.
    """

    held: Out[Item] = port(refers="item", doc="the item in the tool")
    reasons: ClassVar = ("empty",)
    uses: ClassVar = ("tool",)
    senses: ClassVar = True
    tool_state: ClassVar = (ANY, HOLDING)
    tool_left: ClassVar = {"empty": EMPTY}

    def run(self, cell: Cell) -> None:
        """Ask once."""
        believed = cell.ledger.find_held_item()
        if cell.tool.holding and believed is not None:
            self.held = believed
            return
        cell.tool.open()
        if believed is not None:
            cell.ledger.record_drop(believed)
            raise self.failed("empty", f"the sensor feels no seal; {believed} was dropped")
        raise self.failed("empty", "the sensor feels no seal")
