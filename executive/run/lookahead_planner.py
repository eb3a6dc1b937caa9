"""Planner of the next motion during the current motion."""

from __future__ import annotations

from executive.cell.objects import Item
from executive.cell.protocols import Cell
from executive.events import FrameSearched, MotionPlanned, TargetSelected, TimedEvent, ToolCommanded
from executive.manipulation.motions import make_transport_task
from executive.manipulation.tool_goals import (
    make_approach,
    make_bin_goal,
    sort_by_tour,
    sort_pickable_targets,
)


class LookaheadPlanner:
    """Lets the arm plan the motion that the mission will probably need next.

    When the tool holds an item, the planner plans the transit of the item to its bin. During a transit, the
    planner plans the approach to the first target of the shortest tour, which the skill `SelectTarget`
    prefers by default.

    The planner changes no decision, and its reads of the cell are not recorded: a replay needs no planner.

    Args:
        cell: The real cell, without the recorder of inputs.
    """

    def __init__(self, cell: Cell) -> None:
        self._cell = cell
        self._item_and_bin: tuple[Item, str] | None = None
        """Last selected target and its bin."""
        self._grip_tick: int | None = None
        """Control step of the last command to close the tool; None after the plan of the transit."""
        self._change_tick: int | None = None
        """Control step of the last detections or motion; None if the approach has been planned since then."""

    def on_event(self, timed: TimedEvent) -> None:
        """Update the expected motions from an event of the run."""
        event = timed.event
        if isinstance(event, TargetSelected):
            item, bin = event.item, event.bin
            # The selection of an item or a bin that does not exist is ignored.
            items = {target.item for target in self._cell.ledger.find_targets()}
            self._item_and_bin = (item, bin) if bin in self._cell.bins and item in items else None
        elif isinstance(event, ToolCommanded):
            self._grip_tick = timed.tick if event.action == "close" else None
        elif isinstance(event, FrameSearched | MotionPlanned):
            self._change_tick = timed.tick

    def plan_next_motion(self, tick: int) -> None:
        """Plan the next motion if the events of the run make it predictable; called after each tick.

        `tick` is the current control step. Nothing is planned in a control step with new detections, a new
        motion or a command to grip, because such a control step already has a high computational load.
        """
        cell, held_item = self._cell, self._cell.ledger.find_held_item()
        may_hold = self._grip_tick not in (None, tick) and held_item is None
        if may_hold and self._item_and_bin and cell.tool.holding:
            self._grip_tick = None
            item, bin = self._item_and_bin
            cell.arm.plan_ahead(make_bin_goal(cell, bin, item), make_transport_task(cell, item))
        elif self._change_tick not in (None, tick) and held_item is not None and self._is_moving_to_bin():
            self._change_tick = None
            pickable_targets = sort_pickable_targets(cell, cell.ledger.find_targets())
            if targets := sort_by_tour(cell, pickable_targets):
                cell.arm.plan_ahead(*make_approach(cell, targets[0]))

    def _is_moving_to_bin(self) -> bool:
        """Return True if the destination of the arm is in a bin."""
        destination = self._cell.arm.destination
        return any(bin.contains(destination) for bin in self._cell.bins.values())
