"""Skill that localizes detections in the world and assigns them to items."""

from __future__ import annotations

from typing import ClassVar

from executive.cell.detection import Detections
from executive.cell.objects import Target
from executive.cell.protocols import Cell
from executive.errors import NoDepth
from executive.skill import In, Out, Skill, port


class Localize(Skill):
    """Find the position and the item of every detected object.

    Uses the camera pose stored with the frame, so the camera may have moved since. The ledger assigns each
    detection to an item. A detection is in doubt if the size of its box does not fit its class. If the frame
    has a depth image, a detection is also in doubt if the height of its top fits neither an object of its
    class on the table nor such an object on another object.
    """

    detections: In[Detections] = port(doc="the detections and their frame")
    targets: Out[list[Target]] = port(
        doc="one target per open item whose place is known, from this look or an earlier one"
    )
    reasons: ClassVar = ("stale", "no_depth")

    def run(self, cell: Cell) -> None:
        """Localize every detection, then update the ledger."""
        frame = self.detections.frame
        if not cell.ledger.is_current(frame):
            raise self.failure(
                "stale", f"the robot may have moved objects after frame {frame.id} was captured; look again"
            )
        try:
            observations = cell.localizer.localize(self.detections)
        except NoDepth as error:
            raise self.failure("no_depth", str(error)) from error
        self.targets = list(cell.ledger.observe(self.detections, observations))
