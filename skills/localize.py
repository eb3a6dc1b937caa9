"""Skill that localizes detections in the world and assigns them to items."""

from __future__ import annotations

from executive.cell.frame import Detections
from executive.cell.objects import Target
from executive.cell.protocols import Cell, Steps
from executive.manipulation.motions import localize_and_observe
from executive.skill import In, Out, Skill, port


class Localize(Skill):
    """Find the position and the item of every detected object.

    The skill uses the camera pose stored with the frame, because the camera may have moved since the capture.
    The ledger assigns each detection to an item. A detection is doubtful if the size of its box does not fit
    its class, or if the depth image shows its top at a height that its class has neither on the table nor on
    another object.
    """

    detections: In[Detections] = port(doc="the detections and their frame")
    targets: Out[list[Target]] = port(
        doc="a target per unsorted item whose position is known from this or an earlier frame"
    )
    reasons = ("stale", "no_depth")

    def run(self, cell: Cell) -> Steps:
        """Localize every detection, then update the ledger."""
        _, self.targets = yield from localize_and_observe(cell, self.detections)
