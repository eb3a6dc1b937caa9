"""Messages between a run and the server of its live page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from executive.cell.frame import Frame
from executive.cell.visuals import Shape
from executive.events import FrameSearched, TimedEvent
from executive.geometry import Pose


@dataclass(frozen=True)
class PageChange:
    """Change of the page that no event of the run describes; None for unchanged values.

    Attributes:
        clock: Current time on the clock of the run [s].
        tree: Drawing of the tree as an SVG document.
        is_paused: True if the run is paused.
        note: Message about the record of the run.
        result: Outcome of the run: `status`, `message`, `run` directory, and file of the `report` or "".
    """

    clock: float | None = None
    tree: str | None = None
    is_paused: bool | None = None
    note: str | None = None
    result: Mapping[str, str] | None = None


@dataclass(frozen=True)
class CameraImage:
    """Frame without its depth image, and the event with the detections in this frame."""

    frame: Frame
    search_event: FrameSearched


BodyPoses = Mapping[str, Sequence[float]]
"""Poses of all bodies by name: position [m] and quaternion (w, x, y, z), `(7,)`."""


@dataclass(frozen=True)
class SceneChange:
    """Change of the three-dimensional scene: either all shapes, or new poses of all bodies."""

    shapes: Sequence[Shape] | None = None
    body_poses: BodyPoses | None = None


Message = TimedEvent | PageChange | CameraImage | SceneChange
"""Message from the run to the server of the page."""


@dataclass(frozen=True)
class PageCommand:
    """Command of a browser that shows the page, or a report of the server about the browsers.

    Attributes:
        name: `pause`, `resume`, `step`, `stop`, `request`; `render_on_cpu` if the browser renders on the CPU;
            `browsers` if the number of browsers changed.
        text: For `request`: the requested class, `rescan` or `quit`.
        browser_count: For `browsers`: number of browsers.
        is_cpu_rendering: For `browsers`: True if a browser renders on the CPU, and so slows down the run.
    """

    name: str
    text: str = ""
    browser_count: int = 0
    is_cpu_rendering: bool = False


def encode_poses(poses: Mapping[str, Pose]) -> BodyPoses:
    """Return positions [m] and quaternions of bodies by name; reorder (x, y, z, w) to (w, x, y, z)."""
    return {
        name: (*X_WB.position.tolist(), *np.roll(X_WB.quaternion, 1).tolist()) for name, X_WB in poses.items()
    }
