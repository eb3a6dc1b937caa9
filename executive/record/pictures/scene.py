"""Content of a picture as plain data, which knows of neither a run directory nor drawing."""

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
        visible: `(H, W)` bool, False where the arm hides the scene; None where nobody can tell.
        seen: Every detection in the image.
        chosen: Number of the detection that it is all about, or None.
        mission: Name of the mission.
        clock: The moment, on the run's clock [s].
        camera: Name of the camera.
        detector: Name of the detector.
        age: Time since the image was taken [s].
        phase: What the robot is doing: the skills that run.
        item: What `chosen` is believed to be, or "".
        bin: Where that item goes, or "".
        attempts: How many attempts at that item have failed so far.
        failure: Skill and reason of what went wrong (`Grasp.missed`), or "".
        message: What went wrong, in a sentence, or "".
        fates: Items by what became of them: a bin's name, `in the tool`, `rejected`.
        classes: Every class known by now; the place in this list decides on the colour.
    """

    image: NDArray[np.uint8]
    visible: NDArray[np.bool_] | None = None
    _: KW_ONLY
    seen: Sequence[Detection] = ()
    chosen: int | None = None
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
    fates: Mapping[str, Sequence[str]] = field(default_factory=dict)
    classes: Sequence[str] = ()
