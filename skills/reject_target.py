"""Skill that rejects an item."""

from __future__ import annotations

from executive.cell.objects import Item
from executive.cell.protocols import Cell
from executive.skill import In, Skill, param, port

MIN_DROPS_OF_HEAVY_OBJECT = 3
"""Number of drops from which the report calls an object too heavy or slippery."""


class RejectTarget(Skill):
    """Reject an item: the robot leaves the item at its position, and the report lists it.

    Before the item has `after` failed attempts, the skill succeeds without an effect.
    """

    item: In[Item] = port(refers_to="item", doc="the item to reject")
    why: str = param("could not be picked", doc="reason in the report")
    after: int = param(0, ge=0, doc="minimum number of failed attempts before the rejection")

    def run(self, cell: Cell) -> None:
        """Reject the item in the ledger."""
        known = cell.ledger.describe(self.item)
        if known.attempts < self.after:
            return
        reason = f"{self.why} ({known.attempts} failed attempts)" if known.attempts else self.why
        if known.drops >= MIN_DROPS_OF_HEAVY_OBJECT:
            reason += f"; too heavy for the tool, or slippery: the tool dropped it {known.drops} times"
        cell.ledger.reject(self.item, reason)
