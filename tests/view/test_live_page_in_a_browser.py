"""The live page of a simulated run in a real browser: it is shown, and controls the run."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from playwright.sync_api import Page, sync_playwright

pytestmark = pytest.mark.slow
OPTIONS = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
"""WebGL without a graphics card."""
START = 60_000
"""Longest wait for a run to be there [ms]: it loads a simulator and a detector first."""


@pytest.fixture
def address(tmp_path: Path) -> Iterator[str]:
    """The page of a run that stands still before its first step."""
    command = (
        "from executive.cli.main import main; main()", "run", "sort_overhead", "--seed", "5",
        # With 12 objects it takes longer than a loaded computer needs to draw the page.
        "--set", "cell.table.objects=[12, 12]", "--view", "--paused", "--realtime", "--runs", str(tmp_path),
    )  # fmt: skip
    process = subprocess.Popen(
        [sys.executable, "-c", *command], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )  # fmt: skip
    assert process.stderr is not None
    said = process.stderr.readline()
    found = re.fullmatch(r"watch the run at (http://127\.0\.0\.1:[0-9]+/[\w-]{32}/)\n", said)
    assert found, said
    # Whatever it says later must not fill the pipe.
    threading.Thread(target=process.stderr.read, daemon=True).start()
    yield found[1]
    process.terminate()
    process.wait(60)


@pytest.fixture
def page() -> Iterator[Page]:
    """A page of Chromium without a window."""
    path = shutil.which("chromium")
    if path is None:
        pytest.skip("there is no chromium")
    # The sandbox needs rights that root in a container lacks.
    options = [*OPTIONS, *(["--no-sandbox"] if os.geteuid() == 0 else [])]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=options)
        yield browser.new_page(viewport={"width": 1440, "height": 900})
        browser.close()


def take_picture(page: Page, selector: str) -> NDArray[np.uint8]:
    """Return the pixels of an element, BGR `(N, 3)`."""
    data = page.locator(selector).first.screenshot()
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR).reshape(-1, 3)


def test_a_run_is_shown_paused_and_stopped(page: Page, address: str) -> None:
    errors: list[str] = []
    urls: list[str] = []
    page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("request", lambda request: urls.append(request.url))
    page.on("websocket", lambda socket: urls.append(socket.url))
    page.goto(address, timeout=START)
    page.wait_for_selector("#tree g.node.skill", timeout=START)
    assert page.inner_text("#status") == "paused"
    page.click("#resume")
    page.wait_for_selector("#look image", timeout=START)
    page.wait_for_selector("#items tbody tr", timeout=START)
    page.wait_for_selector("#tree g.node.running", state="attached")
    page.click("#pause")
    page.wait_for_selector("#status:text-is('paused')")
    clock = page.inner_text("#clock")
    scene = page.frame_locator("#scene iframe").locator("canvas").first
    scene.wait_for(timeout=START)
    page.wait_for_timeout(3000)  # A browser without a graphics card draws a few frames a second.
    assert page.inner_text("#clock") == clock
    for selector in ("#tree .scroll", "#look .picture"):
        assert len(np.unique(take_picture(page, selector) // 16, axis=0)) > 10, selector
    blue, green, red = take_picture(page, "#scene iframe").astype(int).T
    assert ((red > 120) & (green < 0.5 * red) & (blue < 0.5 * red)).sum() > 200  # a red bin
    assert len(page.query_selector_all("#look rect")) >= 1
    page.click("#stop")
    page.wait_for_selector("#status:text-is('HALTED')", timeout=START)
    assert "halted by the user" in page.inner_text("#outcome")
    assert "report.html" in page.inner_text("#outcome")
    assert errors == []
    hosts = {urlsplit(url).hostname for url in urls if not url.startswith(("data:", "blob:"))}
    assert hosts == {"127.0.0.1"}
