"""State of the live page, and its changes since the last message to the browsers."""

from __future__ import annotations

import base64
from collections import Counter
from dataclasses import asdict
from typing import cast

import numpy as np

from executive import events
from executive.cell.frame import Frame
from executive.record.timeline.timeline import Timeline
from executive.view.live.messages import CameraImage, Change, Message

QUALITY = 80
"""JPEG quality of the camera's image, 0 to 100."""
ARM_SHADE = 0.45
"""Darkening of the pixels that the arm hides: 0 none, 1 black."""

Json = dict[str, object]
"""JSON object for `page.js`: nodes by path, items by name, and one key for each other part of the page."""


class Board:
    """Follows the messages of a run.

    Attributes:
        state: State of the page as JSON.
    """

    def __init__(self) -> None:
        self.state: Json = {"paused": False, "over": False, "nodes": {}, "items": {}}
        self._changes: Json = {}
        self._timeline = Timeline(keeps_history=False)

    def apply(self, message: Message) -> None:
        """Update the state of the page by a message."""
        match message:
            case events.TimedEvent():
                self._timeline(message)
                self._set(clock=message.clock)
                self._apply_event(message.event)
            case CameraImage():
                self._set(look=_encode(message.frame, message.look))
            case Change():
                self._set(**{part: value for part, value in asdict(message).items() if value is not None})

    def take_changes(self) -> Json:
        """Return the changes since the last call, and forget them; empty if there are none."""
        changes, self._changes = self._changes, {}
        return changes

    def _apply_event(self, event: events.Event) -> None:
        match event:
            case events.NodeStarted(node) | events.NodeEnded(node):
                self._set_entry("nodes", node, self._describe_node(node))
            case events.ItemChanged():
                self._set_entry("items", event.item, vars(event))
            case events.TargetSelected():
                self._set(decision=vars(event))
            case events.RunStarted():
                self._set(run={"mission": event.mission, "seed": event.seed})
            case events.OperatorAsked():
                self._set(asking=event.choices)
            case events.RequestGiven():
                self._set(asking=None)
            case events.RunEnded():
                self._set(asking=None, over=True)

    def _describe_node(self, path: str) -> Json:
        last, counts = self._timeline.nodes[path], self._timeline.end_counts.get(path, Counter())
        ends = {"done": "SUCCESS", "failed": "FAILURE", "halted": "INVALID"}
        return {
            **{word: counts[status] for word, status in ends.items()},
            "status": last.status.lower(), "said": last.failure, "item": last.item,
        }  # fmt: skip

    def _set(self, **parts: object) -> None:
        self.state |= parts
        self._changes |= parts

    def _set_entry(self, part: str, name: str, value: Json) -> None:
        for shown in (self.state, self._changes):
            entries = cast("Json", shown.setdefault(part, {}))
            entries[name] = value


def _encode(frame: Frame, look: events.FrameSearched) -> Json:
    """Return a look with its image as JPEG, in which the pixels that the arm hides are darker."""
    import cv2

    shown = cv2.cvtColor(frame.image, cv2.COLOR_RGB2BGR)
    if frame.visible is not None:
        hidden = ~frame.visible
        shown[hidden] = (shown[hidden] * (1 - ARM_SHADE)).astype(np.uint8)
    _, data = cv2.imencode(".jpg", shown, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    height, width = frame.image.shape[:2]
    return {
        "source": "data:image/jpeg;base64," + base64.b64encode(data.tobytes()).decode(),
        "width": width, "height": height, "frame": frame.id, "camera": frame.camera,
        "detector": look.detector, "stamp": frame.stamp, "found": [vars(one) for one in look.found],
    }  # fmt: skip
