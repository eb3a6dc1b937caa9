"""Watching the seal while something is carried, and where it comes down if it slips away."""

from __future__ import annotations

import math

from executive.cell import Cell
from executive.geometry import Array
from executive.messages import Item

GRAVITY = 9.81
"""[m/s²]"""


class Seal:
    """What the tool's sensor says of an item on its way.

    Args:
        cell: The work cell.
        item: What the tool holds.
    """

    def __init__(self, cell: Cell, item: Item) -> None:
        self._cell, self._item = cell, item
        self._place, self._at = cell.arm.tool_pose.position, cell.clock.now

    def broken(self) -> bool:
        """Tell whether the tool does not hold the item any more; to be asked at every tick.

        The ledger is told at once: a look taken while the arm still brakes shows the item where it lies now.
        """
        cell = self._cell
        if cell.tool.holding:
            self._place, self._at = cell.arm.tool_pose.position, cell.clock.now
            return False
        if cell.ledger.in_tool() == self._item:
            cell.ledger.dropped(self._item, self._landing())
        return True

    def _landing(self) -> Array:
        """Return where on the ground it comes down `(3,)` [m], thrown as fast as the tool moved."""
        place, passed = self._cell.arm.tool_pose.position, self._cell.clock.now - self._at
        velocity = (place - self._place) / passed if passed > 0 else 0.0 * place
        height = self._cell.classes[self._cell.ledger.label(self._item)].height
        fall = math.sqrt(2 * max(float(place[2]) - height, 0.0) / GRAVITY)
        landing = place + velocity * fall
        landing[2] = height / 2
        return landing
