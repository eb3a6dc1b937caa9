"""Turn detections into targets in the world."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import ClassVar

from executive.cell.detection import Detection, Detections, Glimpse
from executive.cell.objects import Target
from executive.cell.protocols import Cell
from executive.errors import NoDepth
from executive.geometry import Array
from executive.manipulation.obstacles import is_in_bin
from executive.perception.evidence import describe_wrong_size, describe_wrong_top
from executive.skill import In, Out, Skill, port


class Localize(Skill):
    """Know where every detected object is and which item it is.

    Uses the camera pose stored with the frame, so it holds wherever the camera is by now. The ledger
    binds each detection to an item. A detection is in doubt if its box has not the size of its class. If
    the frame has a depth image, a detection is also in doubt if the height of its top fits neither an
    object of its class on the table nor one on another object.
    """

    detections: In[Detections] = port(doc="the detections and their frame")
    targets: Out[list[Target]] = port(
        doc="one target per open item whose place is known, from this look or an earlier one"
    )
    reasons: ClassVar = ("stale", "no_depth")

    def run(self, cell: Cell) -> None:
        """Locate every detection, then let the ledger say who is who."""
        frame = self.detections.frame
        if not cell.ledger.is_current(frame):
            raise self.failed(
                "stale", f"frame {frame.id} shows the table before change {cell.ledger.epoch}; look again"
            )
        try:
            places = [cell.localizer.locate(detection, frame) for detection in self.detections.found]
            glimpses = list(self._glimpses(cell))
        except NoDepth as error:
            raise self.failed("no_depth", str(error)) from error
        found, positions = [], []
        for detection, place in zip(self.detections.found, places, strict=True):
            doubt = self._contradiction(cell, detection, place)
            if doubt:
                glimpses.append(Glimpse(detection, place, doubt))
            else:
                found.append(detection)
                positions.append(place)
        look = replace(self.detections, found=tuple(found))
        self.targets = list(cell.ledger.observe(look, positions, glimpses))

    def _contradiction(self, cell: Cell, detection: Detection, place: Array) -> str:
        """Return how its box or its top contradicts a class, or ""; in a bin, objects lean and lie deep."""
        if is_in_bin(cell, place):
            return ""
        frame, area, kind = self.detections.frame, self.detections.area, cell.classes[detection.label]
        wrong_size = describe_wrong_size(detection, place, frame, area, kind)
        return wrong_size or describe_wrong_top(detection, place, frame, area, cell.classes)

    def _glimpses(self, cell: Cell) -> Iterator[Glimpse]:
        """Yield where what is in doubt seems to be.

        Raises:
            NoDepth: That is nowhere, and nothing was found for sure, either.
        """
        for detection in self.detections.doubtful:
            try:
                place = cell.localizer.locate(detection, self.detections.frame)
            except NoDepth:
                if not self.detections.found:
                    raise
            else:
                yield Glimpse(detection, place)
