"""Skill that lists items by their state."""

from __future__ import annotations

from executive.cell.objects import Item
from executive.cell.protocols import Cell
from executive.skill import Out, Skill, param, port


class ListItems(Skill):
    """List the known items in a state, in the order of their first detection; the list may be empty.

    `open` items still have to be sorted; `deferred` items are open, too. `skipped` items have no route or
    exceed a quota, and `lost` items were dropped by the tool and not found since.
    """

    items: Out[list[Item]] = port(refers_to="item", doc="the items in this state")
    state: str = param(
        "open",
        choices=("open", "deferred", "placed", "rejected", "skipped", "lost"),
        doc="the state of the items",
    )
    class_: str = param("", refers_to="class", doc="only items of this class; empty: of all classes")
    bin: str = param("", refers_to="bin", doc="only items in this bin; empty: items anywhere")

    def run(self, cell: Cell) -> None:
        """Read the items from the ledger."""
        self.items = [
            known.item
            for known in cell.ledger.list_known_items()
            if (known.is_open if self.state == "open" else known.state == self.state)
            and self.class_ in ("", known.label)
            and self.bin in ("", known.bin)
        ]
