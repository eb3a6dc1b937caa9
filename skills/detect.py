"""Skill that captures an image and detects the objects in it."""

from __future__ import annotations

from typing import ClassVar

from executive.cell.frame import Detections
from executive.cell.protocols import Cell, Steps
from executive.manipulation.motions import capture_and_detect
from executive.manipulation.tool_goals import is_detection_in_bin
from executive.skill import Out, Skill, param, port


class LookingSkill(Skill):
    """Base class of skills that take a look with `capture_and_detect`."""

    detector: str = param("", refers_to="detector", doc="a detector of the cell; empty: the first detector")
    view: str = param("table", choices=("table", "full"), doc="`table`: the workspace; `full`: entire image")
    reasons: ClassVar[tuple[str, ...]] = ("unavailable", "crowded", "camera_moved", "frozen", "wrong_image")
    uses = ("camera",)
    senses = True


class Detect(LookingSkill):
    """Detect the objects in a new image, without blocking the tick loop.

    The output contains all detections that are not doubtful; it may be empty. A detection is doubtful if its
    confidence is below the threshold, or if its second class has more than half of this confidence.
    If all detections on the table are doubtful, the skill fails with `unsure`, or, with `doubtful: pass`,
    succeeds with an empty output. If the arm hides part of the workspace, the skill fails with `hidden`, or,
    with `hidden: pass`, detects objects in the visible part; the hidden part then counts as unknown.
    The skill fails with `crowded` if the detector reports more than 60 boxes of any confidence outside of the
    bins, and with `camera_moved` if the bins in the image are away from their expected positions.
    The skill fails with `wrong_image` if the image has another size or format than declared, with `frozen`
    if the camera repeats an image: the same pixels, no later stamp, or no change where the arm moved.
    """

    detections: Out[Detections] = port(doc="the detections and their frame")
    doubtful: str = param("fail", choices=("fail", "pass"), doc="result if all table detections are doubtful")
    hidden: str = param("fail", choices=("fail", "pass"), doc="result if the arm hides part of the workspace")
    reasons = ("unsure", "hidden", *LookingSkill.reasons)

    def run(self, cell: Cell) -> Steps:
        """Capture a frame, send the frame to the detector, and wait for the answer."""
        camera = cell.camera
        if self.hidden == "fail" and not camera.sees_table():
            raise self.failure("hidden", f"the arm hides part of the workspace from camera {camera.name}")
        look = yield from capture_and_detect(cell, self.detector, self.view)
        on_table = (entry for entry in look.doubtful if not is_detection_in_bin(cell, entry, look.frame))
        if not look.confident and self.doubtful == "fail" and (best := next(on_table, None)):
            raise self.failure("unsure", look.describe_doubt(best))
        self.detections = look
