"""Content of a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field

import numpy as np
from numpy.typing import NDArray

from executive.cell.detection import Detection


@dataclass(frozen=True, eq=False)
class PictureScene:
    """Camera image with its detections and the state of a run, at one moment.

    Attributes:
        image: `(H, W, 3)` uint8, RGB.
        visible: `(H, W)` bool, False for pixels on which the arm hides the scene; None if unknown.
        detections: All detections in the image.
        selected: Index of the detection of `item`, or None.
        mission: Name of the mission.
        clock: Time on the clock of the run [s].
        camera: Name of the camera.
        detector: Name of the detector.
        age: Time since the image was taken [s].
        phase: Names of the running skills.
        item: Name of the selected item, or "".
        bin: Name of the destination of the item, or "".
        attempts: Number of failed attempts to pick the item.
        failure: Skill and reason of the failure (`Grasp.missed`), or "".
        message: Message of the failure, or "".
        outcomes: Names of items by bin, or by state (`in the tool`, `rejected`, ...).
        classes: Detected classes; the index of a class determines its colour.
    """

    image: NDArray[np.uint8]
    visible: NDArray[np.bool_] | None = None
    _: KW_ONLY
    detections: Sequence[Detection] = ()
    selected: int | None = None
    mission: str = ""
    clock: float = 0.0
    camera: str = ""
    detector: str = ""
    age: float = 0.0
    phase: str = ""
    item: str = ""
    bin: str = ""
    attempts: int = 0
    failure: str = ""
    message: str = ""
    outcomes: Mapping[str, Sequence[str]] = field(default_factory=dict)
    classes: Sequence[str] = ()
