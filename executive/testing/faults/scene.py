"""What a disturbance sees of a run, and what it does there."""

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
"""How far from where the ledger believes an item an object may lie and be that item [m]."""

Which = int | Literal["node", "nearest"]
"""An object: its number, from 1; the `nearest` to the tool on the table; or what the `node` is about.

What the node is about is what the ledger takes for its item; a node that is about none means the nearest.
"""


class Scene:
    """A cell and its world, as they are now.

    Args:
        workcell: The cell, undisturbed.
        hand: Returns what reaches into it.
        emit: Tells the run what happens.

    Attributes:
        cell: What skills would see, were there no disturbances.
        emit: Tells the run what happens.
    """

    def __init__(self, workcell: Workcell, hand: Callable[[Workcell], Hand], emit: Emit) -> None:
        self._workcell = workcell
        self._hand_of = hand
        self._motion: tuple[float, Motion] | None = None
        self.cell: Cell = workcell.cell
        self.emit = emit

    @cached_property
    def hand(self) -> Hand:
        """What reaches into the world; looked for when it is needed first."""
        return self._hand_of(self._workcell)

    @property
    def now(self) -> float:
        """Time on the run's clock [s]."""
        return self.cell.clock.now

    @property
    def progress(self) -> float:
        """How much of its motion the arm has behind it, 0 to 1; 0 while it follows none."""
        if self._motion is None:
            return 0.0
        began, motion = self._motion
        if motion.duration == 0.0:
            return 0.0
        share = (self.now - began) / motion.duration
        return share if share <= 1.0 else 0.0

    def started(self, motion: Motion) -> None:
        """Note that the arm begins to follow a motion."""
        self._motion = self.now, motion

    def stopped(self) -> None:
        """Note that the arm was told to brake."""
        self._motion = None

    def find(self, which: Which, item: Item) -> Thing | None:
        """Return an object, or None where there is no such one now; `item` is what the node is about."""
        if isinstance(which, int):
            return next(iter(self.hand.things[which - 1 : which]), None)
        return self._taken_for(item) if which == "node" and item else self._nearest()

    def _taken_for(self, item: Item) -> Thing | None:
        known = next((one for one in self._workcell.accounts.summaries() if one.item == item), None)
        if known is None or known.state == "placed":
            return None
        if known.state == "held":
            return self.hand.held
        return self._closest(np.array(known.position), NEAR)

    def _nearest(self) -> Thing | None:
        return self._closest(self.cell.arm.tool_pose.position, np.inf)

    def _closest(self, position: Array, reach: float) -> Thing | None:
        """Return the object on the table that is closest to a place `(3,)` [m] seen from above."""

        def distance(thing: Thing) -> float:
            return float(np.linalg.norm((thing.position - position)[:2]))

        held = self.hand.held
        there = [thing for thing in self.hand.things if not self._in_bin(thing) and not _same(thing, held)]
        return min((thing for thing in there if distance(thing) <= reach), key=distance, default=None)

    def _in_bin(self, thing: Thing) -> bool:
        return any(bin.contains(thing.position) for bin in self.cell.bins.values())


def _same(thing: Thing, other: Thing | None) -> bool:
    return other is not None and thing.body == other.body
