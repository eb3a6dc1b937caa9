"""Messages between a run and the server of its live page, and the state of the page."""

from __future__ import annotations

import base64
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import cast

import numpy as np

from executive import events
from executive.cell.frame import Frame
from executive.cell.workcell import Shape
from executive.events import FrameSearched, TimedEvent
from executive.geometry import Pose
from executive.record.timeline import Timeline

JPEG_QUALITY = 80
"""JPEG quality of the camera image, 0 to 100."""
OCCLUSION_DARKENING = 0.45
"""Fraction by which the brightness of pixels that the arm occludes is reduced: 0 not at all, 1 to black."""

JsonObject = dict[str, object]
"""Values of a JSON object, by key."""


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


class PageState:
    """State of the live page, updated by the messages of a run.

    Attributes:
        values: All values for `page.js` by key: nodes by path, items by name, and other values.
    """

    def __init__(self) -> None:
        self.values: JsonObject = {"is_paused": False, "has_ended": False, "nodes": {}, "items": {}}
        self._changes: JsonObject = {}
        self._timeline = Timeline(has_history=False)

    def apply(self, message: Message) -> None:
        """Update the state of the page for a message of the run."""
        match message:
            case events.TimedEvent():
                self._timeline(message)
                self._set_values(clock=message.clock)
                self._apply_event(message.event)
            case CameraImage():
                self._set_values(look=_encode_camera_image(message))
            case PageChange():
                changes = asdict(message).items()
                self._set_values(**{key: value for key, value in changes if value is not None})

    def take_changes(self) -> JsonObject:
        """Return the values that changed since the last call, by key."""
        changes, self._changes = self._changes, {}
        return changes

    def _apply_event(self, event: events.Event) -> None:
        match event:
            case events.NodeStarted(node) | events.NodeEnded(node):
                self._set_entry("nodes", node, self._describe_node(node))
            case events.ItemChanged():
                self._set_entry("items", event.item, vars(event))
            case events.TargetSelected():
                self._set_values(decision=vars(event))
            case events.RunStarted():
                self._set_values(run={"mission": event.mission, "seed": event.seed})
            case events.OperatorAsked():
                self._set_values(choices=event.choices)
            case events.RequestGiven():
                self._set_values(choices=None)
            case events.RunEnded():
                self._set_values(choices=None, has_ended=True)

    def _describe_node(self, path: str) -> JsonObject:
        """Return the status, last failure and item of a node, and the number of times it ended by status."""
        activation = self._timeline.activation_by_path[path]
        end_counts = self._timeline.end_counts.get(path, Counter())
        statuses = {"done": "SUCCESS", "failed": "FAILURE", "halted": "INVALID"}
        return {
            **{name: end_counts[status] for name, status in statuses.items()},
            "status": activation.status.lower(), "failure": activation.failure, "item": activation.item,
        }  # fmt: skip

    def _set_values(self, **values: object) -> None:
        """Set values of the state by key, and store them as changes."""
        self.values |= values
        self._changes |= values

    def _set_entry(self, key: str, name: str, value: JsonObject) -> None:
        """Set an entry of `nodes` or `items`, and store it as a change."""
        for values in (self.values, self._changes):
            entries = cast("JsonObject", values.setdefault(key, {}))
            entries[name] = value


def _encode_camera_image(camera_image: CameraImage) -> JsonObject:
    """Return the detections in a frame and its image as JPEG, darkened where the arm occludes the scene."""
    import cv2

    frame = camera_image.frame
    image = cv2.cvtColor(frame.image, cv2.COLOR_RGB2BGR)
    if frame.visible is not None:
        occluded = ~frame.visible
        image[occluded] = (image[occluded] * (1 - OCCLUSION_DARKENING)).astype(np.uint8)
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    height, width, _ = image.shape
    return {
        "source": "data:image/jpeg;base64," + base64.b64encode(data.tobytes()).decode(),
        "width": width, "height": height, "frame": frame.id, "camera": frame.camera,
        "detector": camera_image.search_event.detector, "stamp": frame.stamp,
        "detections": list(map(vars, camera_image.search_event.confident)),
    }  # fmt: skip
