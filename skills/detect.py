"""Search a fresh camera image for objects."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from executive.cell import Cell, LeastTimes, Steps
from executive.errors import Unavailable
from executive.messages import Detections
from executive.skill import Out, Skill, param, port


class Detect(Skill):
    """Know which objects a fresh image shows, beside the running tick loop.

    Succeeds with everything at or above the detector's threshold; an empty list is a result, not a failure.
    """

    detections: Out[Detections] = port(doc="what was found, with the frame it was found in")
    detector: str = param("", refers="detector", doc="which detector of the cell; empty: the first")
    view: str = param(
        "table", choices=("table", "full"), doc="`table`: the workspace; `full`: everything the camera sees"
    )
    doubtful: str = param(
        "fail",
        choices=("fail", "pass"),
        doc="boxes only below the threshold: `fail` as unsure, or `pass` as nothing found",
    )
    reasons: ClassVar = ("unsure", "hidden", "unavailable")
    uses: ClassVar = ("camera",)
    senses: ClassVar = True

    @classmethod
    def shortest(cls, least: LeastTimes, given: Mapping[str, Any]) -> float:
        """Return the time until the detector's answer [s]."""
        return least.answer(given["detector"])

    def run(self, cell: Cell) -> Steps:
        """Take a frame, ask the detector, wait for its answer."""
        if not cell.camera.sees_table():
            raise self.failed("hidden", f"the arm hides part of the workspace from camera {cell.camera.name}")
        name = self.detector or next(iter(cell.detectors))
        detector = cell.detectors[name]
        frame = cell.camera.capture()
        request = detector.request(frame, self.view)
        while not request.ready:
            yield
        try:
            answer = request.result()
        except Unavailable as error:
            raise self.failed("unavailable", f"detector {name}: {error}") from error
        # A model may know more classes than the cell: what the cell does not handle is no object of its.
        answer = [detection for detection in answer if detection.label in cell.classes]
        found = tuple(detection for detection in answer if detection.confidence >= detector.threshold)
        if not found and answer and self.doubtful == "fail":
            best = answer[0]
            raise self.failed(
                "unsure",
                f"detector {name} saw nothing it is sure of: at best a {best.label} "
                f"at {best.confidence:.2f} < {detector.threshold:.2f}",
            )
        self.detections = Detections(frame, found, self.view, cell.camera.area(self.view))
