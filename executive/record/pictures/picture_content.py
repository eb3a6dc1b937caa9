"""Content of a picture: an image with its detections, and the state of the run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field

import numpy as np
from numpy.typing import NDArray

from executive.events import DetectedObject


@dataclass(frozen=True, eq=False)
class PictureContent:
    """Camera image with its detections, and the state of the run at the time of the picture.

    Attributes:
        image: Camera image `(H, W, 3)`, RGB, 0 to 255.
        visible: Mask `(H, W)`, False for pixels in which the arm occludes the scene; None if unknown.
        detections: All detections in the image.
        selected_index: Index in `detections` of the detection of `item`, or None.
        mission: Name of the mission.
        clock: Time on the clock of the run [s].
        camera, detector: Names of the camera and of the detector.
        age: Time since the capture of the image [s].
        running_skills: Names of the running skills.
        item: Name of the selected item, or "".
        bin: Name of the destination of the item, or "".
        failed_attempts: Number of failed attempts to pick the item.
        failure: Name of the failed skill and reason of the failure (`Grasp.missed`), or "".
        message: Message of the failure, or "".
        outcomes: Names of the items in each bin and in each other state (`in the tool`, `rejected`, ...).
        classes: Detected classes; the index of a class determines its colour.
    """

    image: NDArray[np.uint8]
    visible: NDArray[np.bool_] | None = None
    _: KW_ONLY
    detections: Sequence[DetectedObject] = ()
    selected_index: int | None = None
    mission: str = ""
    clock: float = 0.0
    camera: str = ""
    detector: str = ""
    age: float = 0.0
    running_skills: Sequence[str] = ()
    item: str = ""
    bin: str = ""
    failed_attempts: int = 0
    failure: str = ""
    message: str = ""
    outcomes: Mapping[str, Sequence[str]] = field(default_factory=dict)
    classes: Sequence[str] = ()
