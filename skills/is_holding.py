"""Skill that checks if the tool holds an item."""

from __future__ import annotations

from typing import ClassVar

from executive.cell.objects import Item
from executive.cell.protocols import Cell
from executive.skill import ANY, EMPTY, HOLDING, Out, Skill, port


class IsHolding(Skill):
    """Check with the sensor of the tool whether the tool holds an item.

    The skill records a drop if the ledger has an item in the tool, but the sensor detects no seal. A mission
    can use this skill to decide how to continue after a timeout or a failure during a transit.
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
            raise self.failure("empty", f"the sensor detects no seal; {item} was dropped")
        raise self.failure("empty", "the sensor detects no seal")
