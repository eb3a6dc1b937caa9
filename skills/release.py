"""Skill that releases the held item in a bin."""

from __future__ import annotations

from functools import partial

from executive.cell.objects import Item
from executive.cell.protocols import Cell, Steps
from executive.manipulation.motions import release
from executive.skill import ANY, EMPTY, HOLDING, In, Out, Seconds, Skill, param, port


class Release(Skill):
    """Release the held item in its bin and verify that the tool is empty.

    The skill fails with `dropped` if the item fell before its release.
    """

    held: In[Item] = port(refers_to="item", doc="the item in the tool")
    bin: In[str] = port(refers_to="bin", doc="the bin under the tool")
    placed: Out[Item] = port(refers_to="item", doc="the item in the bin")
    settle: Seconds = param(0.10, ge=0, le=2, doc="time to wait before reading the sensor")
    reasons = ("stuck", "dropped")
    uses = ("tool",)
    tool_state = (HOLDING, EMPTY)
    tool_state_after_failure = {"dropped": EMPTY, "halt": ANY}
    waits = "settle"

    def run(self, cell: Cell) -> Steps:
        """Open the tool, wait, and read the sensors of grip and contact."""
        item = self.held
        bin = self.bin
        if cell.ledger.find_held_item() == item:
            record_placement = partial(cell.ledger.record_placement, item, bin)
            falls = cell.bins[bin].contains(cell.arm.tool_pose.position)
            yield from release(self, cell, item, self.settle, record_placement, falls=falls)
            yield  # The next selection of a target needs most of a control period.
        elif cell.ledger.describe(item).state != "placed":
            raise self.failure("dropped", f"{item} is not in the tool any more")
        # A skill that is started again after a halt may find its item already placed.
        self.placed = item
