"""Give an item up."""

from __future__ import annotations

from typing import ClassVar

from executive.cell import Cell, Steps
from executive.messages import Item
from executive.skill import In, Skill, param, port


class RejectTarget(Skill):
    """Mark the item as rejected: it is reported, left where it is, and not tried again."""

    item: In[Item] = port(doc="the item to give up")
    why: str = param("could not be picked", doc="what the report says about it")
    reasons: ClassVar = ()

    def run(self, cell: Cell) -> Steps:
        """Tell the ledger."""
        yield from ()
        failures = cell.ledger.attempts(self.item)
        cell.ledger.rejected(self.item, f"{self.why} ({failures} failed attempts)" if failures else self.why)
