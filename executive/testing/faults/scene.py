"""Scene of a fault: the cell, its world and the motion of the arm."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Literal

import numpy as np

from executive.cell.arm import Motion
from executive.cell.objects import Item
from executive.cell.protocols import Cell
from executive.cell.workcell import Workcell
from executive.events import Emit
from executive.geometry import Array
from executive.testing.faults.hand import Hand, Thing

NEAR = 0.05
"""Distance from the believed position of an item up to which an object counts as that item [m]."""

Which = int | Literal["node", "nearest"]
"""An object: its number, from 1; the one on the table that is `nearest` to the tool; or that of the `node`.

The object of the node is the one that the ledger takes for its item; without an item, it is the nearest.
"""


class FaultScene:
    """A cell and its world, as they are now.

    Args:
        workcell: The cell without faults.
        hand: Returns the access to the world of the cell.
        emit: Emits events of the run.

    Attributes:
        cell: The cell that skills would see without faults.
        emit: Emits events of the run.
        motion: Time at which the arm began its motion [s], and the motion; None if it was stopped.
    """

    def __init__(self, workcell: Workcell, hand: Callable[[Workcell], Hand], emit: Emit) -> None:
        self._workcell = workcell
        self._hand_of = hand
        self.motion: tuple[float, Motion] | None = None
        self.cell: Cell = workcell.cell
        self.emit = emit

    @cached_property
    def hand(self) -> Hand:
        """Access to the world, made at its first use."""
        return self._hand_of(self._workcell)

    @property
    def now(self) -> float:
        """Time on the run's clock [s]."""
        return self.cell.clock.now

    @property
    def progress(self) -> float:
        """Share of its motion that the arm has behind it, 0 to 1; 0 while it follows none."""
        if self.motion is None or self.motion[1].duration == 0.0:
            return 0.0
        share = (self.now - self.motion[0]) / self.motion[1].duration
        return share if share <= 1.0 else 0.0

    def find(self, which: Which, item: Item) -> Thing | None:
        """Return an object, or None if there is none now; `item` is the item of the node."""
        if isinstance(which, int):
            return next(iter(self.hand.things[which - 1 : which]), None)
        if which == "nearest" or not item:
            return self._closest(self.cell.arm.tool_pose.position, np.inf)
        known = next((one for one in self._workcell.accounts.summaries() if one.item == item), None)
        if known is None or known.state == "placed":
            return None
        return self.hand.held if known.state == "held" else self._closest(np.array(known.position), NEAR)

    def _closest(self, position: Array, reach: float) -> Thing | None:
        """Return the object on the table whose horizontal distance from `position` `(3,)` [m] is smallest."""

        def distance(thing: Thing) -> float:
            return float(np.linalg.norm((thing.position - position)[:2]))

        held, bins = self.hand.held, self.cell.bins.values()
        there = [
            thing
            for thing in self.hand.things
            if not any(bin.contains(thing.position) for bin in bins)
            and (held is None or thing.body != held.body)
            and distance(thing) <= reach
        ]
        return min(there, key=distance, default=None)
