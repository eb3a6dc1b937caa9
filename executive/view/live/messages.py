"""Messages between a run and the server of its page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from executive.cell.frame import Frame
from executive.cell.visuals import Shape
from executive.events import FrameSearched, TimedEvent
from executive.geometry import Pose


@dataclass(frozen=True)
class Outcome:
    """End of the run: status, sentence, run directory, and file of the report or ""."""

    status: str
    sentence: str
    run: str
    report: str


@dataclass(frozen=True)
class Change:
    """Change of the page that does not follow from an event; None for an unchanged part.

    Attributes:
        clock: Time of the run [s].
        tree: Drawing of the tree as SVG.
        paused: True if the run is paused.
        note: Sentence about the record.
        result: End of the run.
    """

    clock: float | None = None
    tree: str | None = None
    paused: bool | None = None
    note: str | None = None
    result: Outcome | None = None


@dataclass(frozen=True)
class CameraImage:
    """Frame in which a detector searched, without its depth, and the detections."""

    frame: Frame
    look: FrameSearched


Bodies = Mapping[str, Sequence[float]]
"""Poses of all bodies by name: position [m] and quaternion (w, x, y, z), `(7,)`."""


@dataclass(frozen=True)
class SceneChange:
    """Change of the three-dimensional scene: its shapes at the start, then the poses of its bodies."""

    shapes: Sequence[Shape] | None = None
    bodies: Bodies | None = None


Message = TimedEvent | Change | CameraImage | SceneChange
"""Message of the run to the server."""


@dataclass(frozen=True)
class PageCommand:
    """Command of a watcher, or the number of watchers.

    Attributes:
        do: `pause`, `resume`, `step`, `stop`, `request`, or `watched`.
        word: The requested class, `rescan` or `quit`.
        watchers: Number of watchers.
        is_sparing: True if a browser renders on the CPU, which the run needs.
    """

    do: str
    word: str = ""
    watchers: int = 0
    is_sparing: bool = False


def encode_poses(poses: Mapping[str, Pose]) -> Bodies:
    """Return the poses of bodies as positions and quaternions."""
    return {
        name: (*X_WB.position.tolist(), *np.roll(X_WB.quaternion, 1).tolist()) for name, X_WB in poses.items()
    }
