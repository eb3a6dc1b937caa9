"""Looks of skills: a frame of the camera, and the answer of a detector."""

from __future__ import annotations

from collections.abc import Generator

from executive.cell.detection import Answer
from executive.cell.frame import Frame
from executive.cell.protocols import Cell
from executive.errors import Crowded, Unavailable
from executive.skill import Skill


def take_look(
    skill: Skill, cell: Cell, detector_name: str, view: str
) -> Generator[None, None, tuple[Frame, Answer]]:
    """Capture a frame, wait for the answer of a detector, and return both.

    Args:
        skill: Skill that declares the reasons below.
        cell: The cell.
        detector_name: Name of the detector; "" for the first detector.
        view: Searched region of the image: `table` or `full`.

    Raises:
        SkillFailed: `camera_moved`, `crowded` or `unavailable`.
    """
    frame = cell.camera.capture()
    if displacement := cell.camera.describe_displacement(frame):
        raise skill.failure("camera_moved", displacement)
    request = cell.detectors[detector_name or next(iter(cell.detectors))].request(frame, view)
    while not request.ready:
        yield
    try:
        return frame, request.result()
    except Crowded as error:
        raise skill.failure("crowded", str(error)) from error
    except Unavailable as error:
        raise skill.failure("unavailable", str(error)) from error
