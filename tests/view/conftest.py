"""A real browser, for what a person sees."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

OPTIONS = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
"""WebGL without a graphics card."""


@dataclass
class Visit:
    """One page, and all that the browser said and fetched meanwhile."""

    page: Page
    errors: list[str] = field(default_factory=list)
    fetched: list[str] = field(default_factory=list)

    def colours(self, selector: str) -> int:
        """Return how many colours are to be seen of an element: few where nothing is."""
        import numpy as np

        return len(np.unique(self._pixels(selector) // 16, axis=0))

    def red(self, selector: str) -> int:
        """Return how many pixels of an element are of the red of a bin."""
        blue, green, red = self._pixels(selector).astype(int).T
        return int(((red > 120) & (green < 0.5 * red) & (blue < 0.5 * red)).sum())

    def _pixels(self, selector: str) -> Any:
        import cv2
        import numpy as np

        data = self.page.locator(selector).first.screenshot()
        return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR).reshape(-1, 3)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Debian's Chromium without a window."""
    path = shutil.which("chromium")
    if path is None:
        pytest.skip("there is no chromium")
    # Its own sandbox wants rights that root in a container lacks.
    options = [*OPTIONS, *(["--no-sandbox"] if os.geteuid() == 0 else [])]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=options)
        yield browser
        browser.close()


@pytest.fixture
def visit(browser: Browser) -> Iterator[Visit]:
    """A fresh page that notes every error and every address it asks for."""
    context = browser.new_context(viewport={"width": 1440, "height": 900})
    visit = Visit(context.new_page())

    def note(message: Any) -> None:
        if message.type == "error":
            visit.errors.append(message.text)

    visit.page.on("console", note)
    visit.page.on("pageerror", lambda error: visit.errors.append(str(error)))
    visit.page.on("request", lambda request: visit.fetched.append(request.url))
    visit.page.on("websocket", lambda socket: visit.fetched.append(socket.url))
    yield visit
    context.close()
