"""What the page shows at this moment, as browsers are told of it."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from executive.view.live.telling import Told

QUALITY = 80
"""Of the camera's image, 0 to 100."""
SHADE = 0.45
"""How far what the arm hides goes towards black: 0 not at all, 1 entirely."""


class Board:
    """Follows what the run tells: all of it for whoever comes, what is new for those who are there."""

    def __init__(self) -> None:
        self._shown: dict[str, Any] = {"paused": False, "over": False, "nodes": {}, "items": {}, "notes": []}
        self._fresh: dict[str, Any] = {}
        self._kinds: dict[str, Callable[[Mapping[str, Any]], None]] = {
            "status": self._status, "item": self._item, "look": self._look, "note": self._note,
        }  # fmt: skip

    def take(self, words: Told) -> None:
        """Take in something that the run told."""
        kind, data = words
        if "clock" in data:
            self._show("clock", data["clock"])
        if kind in self._kinds:
            self._kinds[kind](data)
        elif kind == "tree":
            self._show("tree", data["svg"])
        elif kind == "run":
            self._show("run", {"mission": data["mission"], "seed": data["seed"]})
        elif kind == "paused":
            self._show("paused", data["paused"])
        elif kind == "decision":
            self._show("decision", dict(data))
        elif kind == "asking":
            self._show("asking", data["choices"])
        elif kind in ("request", "end"):
            self._show("asking", None)
            if kind == "end":
                self._show("over", True)
        elif kind == "result":
            self._show("result", dict(data))

    def everything(self) -> dict[str, Any]:
        """Return all that is to be shown."""
        return dict(self._shown)

    def news(self) -> dict[str, Any]:
        """Return what is to be shown otherwise than when this was last asked; empty for nothing."""
        fresh, self._fresh = self._fresh, {}
        return fresh

    def _show(self, key: str, value: Any) -> None:
        self._shown[key] = self._fresh[key] = value

    def _status(self, data: Mapping[str, Any]) -> None:
        path, status = data["node"], data["status"]
        node = self._shown["nodes"].get(path) or {"done": 0, "failed": 0, "halted": 0}
        ended = {"SUCCESS": "done", "FAILURE": "failed", "INVALID": "halted"}.get(status)
        if ended:
            node = {**node, ended: node[ended] + 1}
        why = ": ".join(filter(None, (data.get("reason", ""), data.get("message", ""))))
        node |= {"status": status.lower(), "said": why, "item": data.get("item", "")}
        self._shown["nodes"][path] = node
        self._fresh.setdefault("nodes", {})[path] = node

    def _item(self, data: Mapping[str, Any]) -> None:
        self._shown["items"][data["item"]] = dict(data)
        self._fresh.setdefault("items", {})[data["item"]] = dict(data)

    def _note(self, data: Mapping[str, Any]) -> None:
        self._show("notes", [*self._shown["notes"], data["sentence"]])

    def _look(self, data: Mapping[str, Any]) -> None:
        look = {key: value for key, value in data.items() if key not in ("image", "hidden")}
        height, width = data["image"].shape[:2]
        source = _jpeg(data["image"], data["hidden"])
        self._show("look", {**look, "source": source, "width": width, "height": height})


def _jpeg(image: np.ndarray[Any, Any], hidden: np.ndarray[Any, Any] | None) -> str:
    """Return an RGB image as a page takes it, what is hidden darker."""
    import cv2

    shown = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    if hidden is not None:
        shown[hidden] = (shown[hidden] * (1 - SHADE)).astype(np.uint8)
    _, data = cv2.imencode(".jpg", shown, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    return "data:image/jpeg;base64," + base64.b64encode(data.tobytes()).decode()
