"""The live page of a simulated run in a real browser: seen, commanded, and kept from others."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest

pytestmark = pytest.mark.slow
START = 60_000
"""Longest wait for a run to be there [ms]: it loads a simulator and a detector first."""

FOREIGN = """<!doctype html><link rel="icon" href="data:,"><script>
const tried = {};
const done = (what, how) => { tried[what] = how; };
const address = new URLSearchParams(location.search).get("of");
const socket = (path) => new Promise((resolve) => {
  const made = new WebSocket(address.replace("http", "ws") + path, path === "scene" ? ["viser-v1.1.1"] : []);
  made.onmessage = () => resolve("seen");
  made.onerror = () => resolve("refused");
});
const read = (path) => fetch(address + path).then((got) => got.text()).then(() => "seen", () => "refused");
const frame = () => new Promise((resolve) => {
  const made = document.body.appendChild(document.createElement("iframe"));
  made.onload = () => {
    try { resolve(made.contentDocument && made.contentDocument.body.innerText ? "seen" : "refused"); }
    catch { resolve("refused"); }
  };
  made.src = address;
});
window.onload = async () => {
  done("live", await socket("live"));
  done("scene", await socket("scene"));
  done("page", await read(""));
  done("frame", await frame());
  document.title = JSON.stringify(tried);
};
</script><body></body>"""


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


def test_a_run_is_seen_paused_and_stopped(visit, address: str) -> None:
    page = visit.page
    page.goto(address)
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
    for what in ("#tree .scroll", "#look .picture"):
        assert visit.colours(what) > 10, what
    assert visit.red("#scene iframe") > 200
    assert len(page.query_selector_all("#look rect")) >= 1
    page.click("#stop")
    page.wait_for_selector("#status:text-is('HALTED')", timeout=START)
    assert "halted by the user" in page.inner_text("#outcome")
    assert "report.html" in page.inner_text("#outcome")
    assert visit.errors == []
    hosts = {urlsplit(url).hostname for url in visit.fetched if not url.startswith(("data:", "blob:"))}
    assert hosts == {"127.0.0.1"}


def test_a_page_elsewhere_can_neither_see_nor_command_it(visit, address: str) -> None:
    page = visit.page
    page.goto(address)
    page.wait_for_selector("#tree g.node.skill", timeout=START)
    other, elsewhere = page.context.new_page(), "http://127.0.0.1:9999/"
    answer = {"body": FOREIGN, "content_type": "text/html"}
    other.route(lambda url: url.startswith(elsewhere), lambda route: route.fulfill(**answer))
    other.goto(f"{elsewhere}?of={address}")
    other.wait_for_function("document.title.startsWith('{')", timeout=START)
    assert other.title() == '{"live":"refused","scene":"refused","page":"refused","frame":"refused"}'
    assert page.inner_text("#status") == "paused"
