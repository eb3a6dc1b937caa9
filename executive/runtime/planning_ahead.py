"""Service of a run that has the arm plan its next motion while the run still needs the one before."""

from __future__ import annotations

from executive.cell import Cell
from executive.events import Event
from executive.goals import approach, into, nearest_first
from executive.messages import Item
from executive.moving import carrying


class PlanningAhead:
    """Asks the arm for the motions that the mission will probably need next.

    These are the way of the selected item into its bin, as soon as the tool holds it, and the approach to the
    most likely next target, while the arm carries. One target is enough: on 60 runs of `sort_overhead` and
    `sort_wrist` it was the one that `SelectTarget` then chose for all 222 approaches after a carry.

    Planning ahead decides nothing. It acts on the cell below the tape, so it is no part of the record, and a
    replay does without it.

    Args:
        cell: The work cell itself.
    """

    def __init__(self, cell: Cell) -> None:
        self._cell = cell
        self._selected: tuple[Item, str] | None = None
        self._is_closing = False
        self._has_news = False

    def take(self, event: Event) -> None:
        """Note an event of the run that changes what comes next."""
        if event.kind == "decision":
            self._selected = event.data["item"], event.data["bin"]
        elif event.kind == "intent":
            self._is_closing = event.data["action"] == "close"
        elif event.kind in ("look", "plan"):
            self._has_news = True

    def step(self) -> None:
        """Plan what became known in this control step; called once after the tree was ticked."""
        cell = self._cell
        if self._is_closing and self._selected and cell.tool.holding:
            self._is_closing = False
            item, bin = self._selected
            cell.arm.plan_ahead(into(cell, bin, item), carrying(cell, item))
        elif self._has_news and self._is_delivering():
            self._has_news = False
            for target in nearest_first(cell, cell.ledger.targets())[:1]:
                cell.arm.plan_ahead(*approach(cell, target))

    def _is_delivering(self) -> bool:
        """Return whether the arm will be above a bin with what the tool holds: it is free after that."""
        if self._cell.ledger.in_tool() is None:
            return False
        end = self._cell.arm.destination
        return any(bin.contains(end) for bin in self._cell.bins.values())
