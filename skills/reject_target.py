"""Give an item up."""

from __future__ import annotations

from typing import ClassVar

from executive.cell.objects import Item
from executive.cell.protocols import Cell
from executive.skill import In, Skill, param, port


class RejectTarget(Skill):
    """Mark the item as rejected: it is reported, left where it is, and not tried again.

    With `after`, only once its grasps have failed that often; until then this does nothing and succeeds.
    """

    item: In[Item] = port(refers="item", doc="the item to give up")
    why: str = param("could not be picked", doc="what the report says about it")
    after: int = param(0, ge=0, doc="failed attempts from which it is given up")
    reasons: ClassVar = ()

    def run(self, cell: Cell) -> None:
        """Tell the ledger."""
        failures = cell.ledger.count_attempts(self.item)
        if failures < self.after:
            return
        cell.ledger.reject(self.item, f"{self.why} ({failures} failed attempts)" if failures else self.why)
