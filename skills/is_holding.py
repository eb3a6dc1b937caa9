"""Skill that checks if the tool holds an item."""

from __future__ import annotations

from typing import ClassVar

from executive.cell.objects import Item
from executive.cell.protocols import Cell
from executive.skill import ANY, EMPTY, HOLDING, Out, Skill, port


class IsHolding(Skill):
    """Check by the tool's sensor whether the tool holds an item.

    If the ledger has an item in the tool and the sensor feels none, the item is recorded as dropped. After a
    timeout or a failure during a transit, the result decides how the mission continues.
    """

    held: Out[Item] = port(refers="item", doc="the item in the tool")
    reasons: ClassVar = ("empty",)
    uses: ClassVar = ("tool",)
    senses: ClassVar = True
    tool_state: ClassVar = (ANY, HOLDING)
    tool_left: ClassVar = {"empty": EMPTY}

    def run(self, cell: Cell) -> None:
        """Compare the vacuum sensor with the ledger."""
        item = cell.ledger.find_held_item()
        if cell.tool.holding and item is not None:
            self.held = item
            return
        cell.tool.open()
        if item is not None:
            cell.ledger.record_drop(item)
            raise self.failure("empty", f"the sensor feels no seal; {item} was dropped")
        raise self.failure("empty", "the sensor feels no seal")
