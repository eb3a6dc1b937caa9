"""Search a fresh camera image for objects."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from executive.cell.detection import Detection, Detections
from executive.cell.frame import Frame
from executive.cell.protocols import Cell, LeastTimes, Steps
from executive.errors import NoDepth, Unavailable
from executive.manipulation.obstacles import is_in_bin
from executive.skill import Out, Skill, param, port

MIN_VISIBLE_SHARE = 0.7
"""Smallest visible share of a box that counts; the arm may hide the rest."""
MAX_BOXES = 60
"""Maximum number of boxes in one look, doubtful ones and unknown labels included. Shipped cells hold at most
20 objects, and the time to match boxes with items grows faster than their number."""
MAX_PIXEL = 1e5
"""Largest valid coordinate of a box [pixel]: no image is larger, and the squares of much larger coordinates
overflow."""
MAX_LABEL = 100
"""Largest number of characters of a label: it appears in messages and on the terminal."""
MAX_SECOND_RATIO = 0.5
"""Largest ratio of the second to the first class confidence at which a box is not in doubt."""


class Detect(Skill):
    """Detect the objects in a new image without blocking the tick loop.

    Succeeds with all detections that are not in doubt. A detection is in doubt if it is below the detector's
    threshold or if its second class is more than half as likely. An empty list is a result, not a failure.
    The area hidden by the arm counts neither as empty nor as occupied.
    A look with more than 60 boxes fails with `crowded`, whatever their confidence.
    Fails with `camera_moved` if the image shows the bins away from their expected positions.
    """

    detections: Out[Detections] = port(doc="the detections and their frame")
    detector: str = param("", refers="detector", doc="which detector of the cell; empty: the first")
    view: str = param(
        "table", choices=("table", "full"), doc="`table`: the workspace; `full`: everything the camera sees"
    )
    doubtful: str = param(
        "fail",
        choices=("fail", "pass"),
        doc="if all detections on the table are in doubt: `fail` with `unsure`, or `pass` with no detections",
    )
    hidden: str = param(
        "fail",
        choices=("fail", "pass"),
        doc="if the arm hides part of the workspace: `fail` with `hidden`, or `pass` and search the rest",
    )
    reasons: ClassVar = ("unsure", "hidden", "unavailable", "crowded", "camera_moved")
    uses: ClassVar = ("camera",)
    senses: ClassVar = True

    @classmethod
    def shortest(cls, least: LeastTimes, given: Mapping[str, Any]) -> float:
        """Return the time until the detector's answer [s]."""
        return least.answer(given["detector"])

    def run(self, cell: Cell) -> Steps:
        """Take a frame, ask the detector, wait for its answer."""
        if self.hidden == "fail" and not cell.camera.sees_table():
            raise self.failed("hidden", f"the arm hides part of the workspace from camera {cell.camera.name}")
        name = self.detector or next(iter(cell.detectors))
        detector = cell.detectors[name]
        frame = cell.camera.capture()
        if displacement := cell.camera.displacement(frame):
            raise self.failed("camera_moved", displacement)
        request = detector.request(frame, self.view)
        while not request.ready:
            yield
        try:
            answer = request.result()
        except Unavailable as error:
            raise self.failed("unavailable", f"detector {name}: {error}") from error
        if len(answer.found) > MAX_BOXES:
            raise self.failed(
                "crowded",
                f"detector {answer.detector} found {len(answer.found)} boxes in the view {self.view}, which "
                f"cannot all be objects; at most {MAX_BOXES} are allowed: raise `floor` of the detector in "
                "the cell file, or use another detector",
            )
        if invalid := next((one for one in answer.found if not _is_valid(one)), None):
            raise self.failed(
                "unavailable",
                f"detector {answer.detector} gave an invalid box: {invalid.label[:MAX_LABEL]!r} "
                f"{invalid.confidence:g} at {invalid.box}",
            )
        visible = [one for one in answer.found if frame.visible_share(one.box) >= MIN_VISIBLE_SHARE]
        known = [one for one in visible if one.label in cell.classes]
        threshold = answer.error_rates.threshold
        unknown = tuple(
            one for one in visible if one.label not in cell.classes and one.confidence >= threshold
        )
        found = tuple(one for one in known if _is_clear(one, threshold))
        doubtful = tuple(one for one in known if not _is_clear(one, threshold))
        on_table = (one for one in doubtful if not _shows_bin_content(cell, one, frame))
        if not found and self.doubtful == "fail" and (best := next(on_table, None)):
            weak = best.confidence < threshold
            limit = f"< {threshold:.2f}" if weak else f"with another class at {best.rival:.2f}"
            raise self.failed(
                "unsure",
                f"detector {answer.detector} found nothing certain: at best a {best.label} "
                f"at {best.confidence:.2f} {limit}",
            )
        self.detections = Detections(
            frame,
            found,
            answer.detector,
            answer.error_rates,
            self.view,
            cell.camera.area(self.view),
            doubtful,
            unknown,
        )


def _is_clear(detection: Detection, threshold: float) -> bool:
    """Return True if a detection is confident enough, and its second class at most half as likely."""
    confidence = detection.confidence
    return confidence >= threshold and detection.rival <= MAX_SECOND_RATIO * confidence


def _shows_bin_content(cell: Cell, detection: Detection, frame: Frame) -> bool:
    """Return True if a detection is at a position in a bin; the ledger knows the objects there."""
    try:
        position = cell.localizer.locate(detection, frame)
    except NoDepth:
        return False
    return is_in_bin(cell, position)


def _is_valid(detection: Detection) -> bool:
    """Return True if a detection has a possible box, a possible confidence and a printable label."""
    left, top, right, bottom = detection.box
    # The comparisons are False for numbers that are not finite.
    in_reach = all(abs(edge) <= MAX_PIXEL for edge in detection.box)
    printable = detection.label.isprintable() and len(detection.label) <= MAX_LABEL
    return in_reach and left <= right and top <= bottom and 0.0 <= detection.confidence <= 1.0 and printable
