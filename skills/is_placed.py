"""Condition that an item is in a bin."""

from __future__ import annotations

from executive.cell.objects import Item
from executive.cell.protocols import Cell
from executive.skill import In, Skill, port


class IsPlaced(Skill):
    """Succeed if the item is in a bin according to the ledger."""

    item: In[Item] = port(refers_to="item", doc="the item that is checked")
    is_condition = True
    reasons = ("not_placed",)

    def run(self, cell: Cell) -> None:
        """Ask the ledger for the state of the item."""
        if cell.ledger.describe(self.item).state != "placed":
            raise self.failure("not_placed", f"{self.item} is in no bin")
