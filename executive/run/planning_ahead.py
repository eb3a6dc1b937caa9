"""Run observer that lets the arm plan its next motion during the current motion."""

from __future__ import annotations

from executive.cell.objects import Item
from executive.cell.protocols import Cell
from executive.events import FrameSearched, MotionPlanned, TargetSelected, TimedEvent, ToolCommanded
from executive.manipulation.motions import task_of_carrying
from executive.manipulation.tool_goals import approach, goal_in_bin, nearest_first


class PlanningAhead:
    """Asks the arm for the motions that the mission will probably need next.

    It plans two motions: the transit of the selected item to its bin, as soon as the tool holds the item, and
    the approach to the most likely next target, during that transit. One target is enough: in 60 runs of
    `sort_overhead` and `sort_wrist`, `SelectTarget` later chose that target in all 222 approaches that
    followed a transit.

    Planning ahead never changes a decision of the run. Its reads of the cell are not recorded, so a replay
    works without it.

    Args:
        cell: The real cell, whose answers are not recorded.
    """

    def __init__(self, cell: Cell) -> None:
        self._cell = cell
        self._selected: tuple[Item, str] | None = None
        self._is_closing = False
        self._approach_is_outdated = False

    def observe(self, timed: TimedEvent) -> None:
        """Update the expected next motions from an event of the run."""
        event = timed.event
        if isinstance(event, TargetSelected):
            item, bin = event.item, event.bin
            # If a skill selects an item or a bin that the cell does not know, no motion can be planned.
            items = {target.item for target in self._cell.ledger.find_targets()}
            self._selected = (item, bin) if bin in self._cell.bins and item in items else None
        elif isinstance(event, ToolCommanded):
            self._is_closing = event.action == "close"
        elif isinstance(event, FrameSearched | MotionPlanned):
            self._approach_is_outdated = True

    def step(self) -> None:
        """Plan the next motion as soon as it is known; called after each tick."""
        cell = self._cell
        if self._is_closing and self._selected and cell.ledger.find_held_item() is None and cell.tool.holding:
            self._is_closing = False
            item, bin = self._selected
            cell.arm.plan_ahead(goal_in_bin(cell, bin, item), task_of_carrying(cell, item))
        elif self._approach_is_outdated and self._is_delivering():
            self._approach_is_outdated = False
            for target in nearest_first(cell, cell.ledger.find_targets())[:1]:
                cell.arm.plan_ahead(*approach(cell, target))

    def _is_delivering(self) -> bool:
        """Return True if the arm carries a held item to a bin, from which the next approach starts."""
        if self._cell.ledger.find_held_item() is None:
            return False
        destination = self._cell.arm.destination
        return any(bin.contains(destination) for bin in self._cell.bins.values())
