"""State of the page at this moment, and its news since browsers were told last."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from executive.view.live.telling import News

QUALITY = 80
"""JPEG quality of the camera's image, 0 to 100."""
SHADE = 0.45
"""Darkening of the pixels that the arm hides: 0 none, 1 black."""


class Board:
    """Follows the news of a run.

    Attributes:
        everything: All that is to be shown.
    """

    def __init__(self) -> None:
        self.everything: News = {"paused": False, "over": False, "nodes": {}, "items": {}}
        self._news: News = {}

    def take(self, news: News) -> None:
        """Take in what is to be shown otherwise; nodes and items that it does not name stay as they are."""
        if "look" in news:
            news = {**news, "look": _encoded(**news["look"])}
        for shown in (self.everything, self._news):
            for key, value in news.items():
                if key in ("nodes", "items"):
                    shown.setdefault(key, {}).update(value)
                else:
                    shown[key] = value

    def news(self) -> News:
        """Return what is to be shown otherwise than when this was last asked; empty for nothing."""
        fresh, self._news = self._news, {}
        return fresh


def _encoded(image: np.ndarray[Any, Any], hidden: np.ndarray[Any, Any] | None, **look: Any) -> News:
    """Return a look with its RGB image as a page takes it, hidden pixels darker."""
    import cv2

    shown = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    if hidden is not None:
        shown[hidden] = (shown[hidden] * (1 - SHADE)).astype(np.uint8)
    _, data = cv2.imencode(".jpg", shown, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    source = "data:image/jpeg;base64," + base64.b64encode(data.tobytes()).decode()
    height, width = image.shape[:2]
    return {**look, "source": source, "width": width, "height": height}
