"""What the page is told: a word for its kind, and plain data; small, for it is told during the run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from executive.events import Event
from executive.geometry import Pose

Told = tuple[str, Mapping[str, Any]]

_KEPT = {
    "run": ("mission", "seed"),
    "status": ("node", "status", "reason", "message", "item"),
    "item": ("item", "label", "state", "bin", "why", "position"),
    "decision": ("item", "label", "frame", "bin"),
    "asking": ("choices",),
    "request": ("wanted",),
    "resume": (),
    "end": ("status", "reason", "message"),
}
"""What is told of an event, by its kind; of others nothing."""


def told(event: Event) -> Told | None:
    """Return what the page is told of an event, or None for nothing."""
    keys = _KEPT.get(event.kind)
    if keys is None:
        return None
    data = {key: _plain(event.data[key]) for key in keys if key in event.data}
    return event.kind, {"clock": event.clock, **data}


def picture(look: Event) -> Told:
    """Return what the page is told of a look: the image `(H, W, 3)` and what was found in it."""
    frame = look.data["frame_object"]
    found = [
        {"label": box["label"], "confidence": float(box["confidence"]), "box": _plain(box["box"]),
         "position": _plain(box.get("position"))}
        for box in look.data.get("found", ())
    ]  # fmt: skip
    return "look", {
        "image": frame.image,
        "hidden": None if frame.visible is None or frame.visible.all() else ~frame.visible,
        "frame": frame.id,
        "camera": frame.camera,
        "detector": look.data.get("detector", ""),
        "stamp": frame.stamp,
        "found": found,
    }


def poses(clock: float, places: Mapping[str, Pose]) -> Told:
    """Return where every body is: its name, position [m] and quaternion (w, x, y, z)."""
    found = {
        name: (*X_WB.position.tolist(), *np.roll(X_WB.quaternion, 1).tolist())
        for name, X_WB in places.items()
    }
    return "poses", {"clock": clock, "bodies": found}


def _plain(value: Any) -> Any:
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    return [_plain(each) for each in value] if isinstance(value, (list, tuple)) else value
