"""Skill that moves an item to the end of the order of selection."""

from __future__ import annotations

from executive.cell.objects import Item
from executive.cell.protocols import Cell
from executive.skill import In, Skill, param, port


class Defer(Skill):
    """Defer an item: `SelectTarget` selects the item only after every other candidate.

    The item stays open. Deferred items are selected in the order of their deferral. The skill fails with
    `exhausted` if the item was already deferred as often as `times` permits. An item in the tool or in a bin
    keeps its state; the deferral has an effect if the item returns to the table.
    """

    item: In[Item] = port(refers_to="item", doc="the item to defer")
    times: int = param(1, ge=1, doc="maximum number of times that the mission defers one item")
    reasons = ("exhausted",)

    def run(self, cell: Cell) -> None:
        """Defer the item in the ledger."""
        count = cell.ledger.describe(self.item).deferrals
        if count >= self.times:
            raise self.failure("exhausted", f"{self.item} was already deferred {count} times")
        cell.ledger.defer(self.item)
