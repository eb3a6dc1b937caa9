"""News of a run for its page: plain data, and little of it, for it is gathered during the run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from executive.cell.frame import Frame
from executive.events import FrameSearched
from executive.geometry import Pose
from executive.record.entry import OldEvent as Event

News = dict[str, Any]
"""Changes of the page: `clock` [s], `nodes` and `items` by name, and one key for each other part."""

_ENDS = {"SUCCESS": "done", "FAILURE": "failed", "INVALID": "halted"}


class Teller:
    """Turns the events of a run into news; counts how every node ended."""

    def __init__(self) -> None:
        self._ends: dict[str, dict[str, int]] = {}

    def news(self, event: Event) -> News | None:
        """Return the news of an event, or None for nothing."""
        data, clock = event.data, {"clock": event.clock}
        if event.kind == "status":
            return clock | {"nodes": {data["node"]: self._node(data)}}
        if event.kind == "item":
            return clock | {
                "items": {data["item"]: _some(data, "item", "label", "state", "bin", "why", "position")}
            }
        if event.kind == "decision":
            return clock | {"decision": _some(data, "item", "label", "frame", "bin")}
        if event.kind == "run":
            return clock | {"run": _some(data, "mission", "seed")}
        if event.kind == "asking":
            return clock | {"asking": _plain(data["choices"])}
        if event.kind in ("request", "end"):
            over = {"over": True} if event.kind == "end" else {}
            return clock | {"asking": None} | over
        return clock if event.kind == "resume" else None

    def _node(self, data: Mapping[str, Any]) -> News:
        status = data["status"]
        ends = self._ends.setdefault(data["node"], dict.fromkeys(_ENDS.values(), 0))
        if status in _ENDS:
            ends[_ENDS[status]] += 1
        why = ": ".join(filter(None, (data.get("reason", ""), data.get("message", ""))))
        return {**ends, "status": status.lower(), "said": why, "item": data.get("item", "")}


def picture(frame: Frame, look: FrameSearched) -> News:
    """Return the news of a look: the image `(H, W, 3)`, the pixels that the arm hides, and what was found."""
    found = [
        {"label": one.label, "confidence": one.confidence, "box": one.box, "position": one.position}
        for one in look.found
    ]
    return {
        "look": {
            "image": frame.image,
            "hidden": None if frame.visible is None or frame.visible.all() else ~frame.visible,
            "frame": frame.id,
            "camera": frame.camera,
            "detector": look.detector,
            "stamp": frame.stamp,
            "found": found,
        }
    }


def poses(clock: float, places: Mapping[str, Pose]) -> News:
    """Return where every body is: by its name position [m] and quaternion (w, x, y, z)."""
    found = {
        name: (*X_WB.position.tolist(), *np.roll(X_WB.quaternion, 1).tolist())
        for name, X_WB in places.items()
    }
    return {"clock": clock, "bodies": found}


def _some(data: Mapping[str, Any], *keys: str) -> News:
    return {key: _plain(data[key]) for key in keys if key in data}


def _plain(value: Any) -> Any:
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    return [_plain(each) for each in value] if isinstance(value, (list, tuple)) else value
