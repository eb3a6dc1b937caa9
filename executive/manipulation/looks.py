"""Base class of skills that take a look: a frame of the camera, and the detections of a detector in it."""

from __future__ import annotations

from collections.abc import Generator
from typing import ClassVar

from executive.cell.frame import Detections
from executive.cell.protocols import Cell
from executive.errors import Crowded, Unavailable
from executive.skill import Skill, param


class LookingSkill(Skill):
    """Base class of skills that capture a frame and wait for the answer of a detector."""

    detector: str = param("", refers_to="detector", doc="a detector of the cell; empty: the first detector")
    view: str = param("table", choices=("table", "full"), doc="`table`: the workspace; `full`: entire image")
    reasons: ClassVar[tuple[str, ...]] = ("unavailable", "crowded", "camera_moved")
    uses = ("camera",)
    senses = True

    def capture_and_detect(self, cell: Cell) -> Generator[None, None, Detections]:
        """Capture a frame, yield until the detector has answered, and return its detections.

        Raises:
            SkillFailed: `camera_moved`, `crowded` or `unavailable`.
        """
        frame = cell.camera.capture()
        request = cell.detectors[self.detector or next(iter(cell.detectors))].request(frame, self.view)
        # The detector searches the frame during this check.
        if displacement := cell.camera.describe_displacement(frame):
            raise self.failure("camera_moved", displacement)
        while not request.ready:
            yield
        try:
            answer = request.result()
        except Crowded as error:
            raise self.failure("crowded", str(error)) from error
        except Unavailable as error:
            raise self.failure("unavailable", str(error)) from error
        area = cell.camera.get_view_box(self.view)
        return Detections(**vars(answer), frame=frame, view=self.view, area=area)
