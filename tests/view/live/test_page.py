"""The live page of a run on the fake cell: what it shows, what it does, and what it leaves."""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import signal
import threading
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import aiohttp
import numpy as np
import pytest
from events import at, frame_searched

from executive.cell.frame import Frame, FrameCaptured
from executive.cells.fake.cell import FakeCell
from executive.events import RunEnded
from executive.geometry import Pose
from executive.mission.load import load_mission
from executive.plugins import load_skills
from executive.record.result import Result
from executive.run.assembly import RunOptions, assemble
from executive.run.run import Run
from executive.view.live.page import MAX_QUEUED_MESSAGES, LivePage
from tests.record.conftest import MISSION

RESULT = Result(mission="sort", seed=3, status="SUCCESS", reason="", message="", node="", run="runs/x")


class Watched:
    """A run with its page, and a browser's connection to it."""

    def __init__(self, run: Run, page: LivePage, socket: aiohttp.ClientWebSocketResponse) -> None:
        self.run, self.page, self.socket = run, page, socket
        self.shown: dict[str, Any] = {}

    async def until(self, holds: Callable[[dict[str, Any]], Any]) -> dict[str, Any]:
        """Take in news until something holds of what is shown."""
        while not (self.shown and holds(self.shown)):
            news = await self.socket.receive_json(timeout=20)
            for key in ("nodes", "items"):
                self.shown.setdefault(key, {}).update(news.pop(key, {}))
            self.shown |= news
        return self.shown

    async def wish(self, **what: str) -> None:
        await self.socket.send_json(what)


def watch(text: str, folder: Path, do: Callable[[Watched], Awaitable[None]]) -> RunEnded:
    """Execute a run that is paused first, while something is done at its page."""
    file = folder / "mission.yaml"
    file.write_text(text)
    loaded = load_mission(file, load_skills())
    page = LivePage()
    # In real time, so that there is something to pause.
    options = RunOptions(3, has_keyboard=False, is_realtime=True, make_cell=FakeCell)
    run = assemble(loaded, options, [page])
    run.control.pause()
    page.open(run)
    outcomes: list[RunEnded] = []
    # Signals are heard in the main thread only, so the run goes on as it would there.
    runner = threading.Thread(target=lambda: outcomes.append(run.execute()))

    async def visit() -> None:
        origin = page.address.rsplit("/", 2)[0]
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(f"{page.address}live", headers={"Origin": origin}) as socket,
        ):
            watched = Watched(run, page, socket)
            await watched.until(lambda shown: "tree" in shown)
            runner.start()
            await do(watched)

    try:
        asyncio.run(visit())
    finally:
        run.control.stop()
        with contextlib.suppress(RuntimeError):
            runner.join()
        page.finish()
        run.close()
    return outcomes[0]


@pytest.mark.slow
def test_a_watcher_sees_a_first_step_then_the_run_to_its_end(tmp_path: Path) -> None:
    async def do(watched: Watched) -> None:
        await watched.wish(name="step")
        await watched.until(lambda shown: shown.get("clock", 0.0) > 0.0)
        assert watched.run.tick == 1
        await watched.wish(name="resume")
        shown = await watched.until(lambda shown: shown.get("has_ended"))
        assert '<svg xmlns="http://www.w3.org/2000/svg" class="behaviour-tree"' in shown["tree"]
        assert shown["nodes"]["tree/Release"]["status"] == "success"
        assert shown["run"] == {"mission": "bring_one", "seed": 3}
        assert {item["state"] for item in shown["items"].values()} >= {"placed"}
        assert shown["look"]["source"].startswith("data:image/jpeg;base64,")
        watched.page.finish(RESULT, "runs/x/report.html")
        shown = await watched.until(lambda shown: "result" in shown)
        assert shown["result"]["report"] == "runs/x/report.html"

    assert watch(MISSION, tmp_path, do).status == "SUCCESS"


@pytest.mark.slow
def test_what_is_to_be_picked_can_be_said_on_the_page(tmp_path: Path) -> None:
    async def do(watched: Watched) -> None:
        await watched.wish(name="resume")
        shown = await watched.until(lambda shown: shown.get("choices"))
        assert shown["choices"] == ["cube", "sphere", "duck"]
        for text in ("a unicorn", "sphere"):
            await watched.wish(name="request", text=text)
        await watched.until(lambda shown: shown.get("has_ended"))

    asking = re.sub(r"tree: .*", "tree: [AwaitRequest]", MISSION)
    assert watch(asking, tmp_path, do).status == "SUCCESS"


@pytest.mark.slow
def test_it_listens_on_loopback_only_and_at_one_port() -> None:
    page = LivePage()
    try:
        # Once it answers, all that will ever listen does.
        asyncio.run(_answered(page.address))
        files = Path(f"/proc/{page._server.pid}/fd")
        held = {os.readlink(file) for file in files.iterdir()}
        listening = []
        for table in ("tcp", "tcp6"):
            for line in Path(f"/proc/{page._server.pid}/net/{table}").read_text().splitlines()[1:]:
                fields = line.split()
                if fields[3] == "0A" and f"socket:[{fields[9]}]" in held:
                    listening.append(fields[1])
        port = int(page.address.split(":")[2].partition("/")[0])
        assert listening == [f"0100007F:{port:04X}"]
    finally:
        page.finish()


async def _answered(address: str) -> None:
    async with aiohttp.ClientSession() as session, session.get(address) as answer:
        assert answer.status == 200


@pytest.mark.slow
def test_a_page_that_died_costs_the_run_nothing(tmp_path: Path) -> None:
    file = tmp_path / "mission.yaml"
    file.write_text(MISSION)
    page = LivePage()
    run = assemble(load_mission(file, load_skills()), RunOptions(3, make_cell=FakeCell), [page])
    page.open(run)
    page._server.kill()
    assert run.execute().status == "SUCCESS"
    page.finish(RESULT)
    assert page.problem == "the page ended before the run: exit status -9"
    run.close()


@pytest.mark.slow
def test_a_hanging_page_receives_a_limited_queue_and_costs_a_few_seconds(monkeypatch) -> None:
    monkeypatch.setattr("executive.view.live.page.SHUTDOWN_TIMEOUT", 0.2)
    page = LivePage()
    asyncio.run(_answered(page.address))
    page._server.send_signal(signal.SIGSTOP)
    page._browser_count = 1
    image = np.zeros((480, 640, 3), np.uint8)
    frame = Frame(1, "overhead", image, None, np.eye(3), Pose.identity(), 0.0, None, 0)
    for tick in range(200):
        page(at(tick, FrameCaptured(frame)))
        page(at(tick, frame_searched()))
    assert page._queue.qsize() <= MAX_QUEUED_MESSAGES
    page.finish(RESULT)
    assert page._server.returncode == -signal.SIGKILL


def test_what_goes_wrong_with_it_is_said_and_the_run_goes_on() -> None:
    page = LivePage()
    try:
        for page._browser_count in (0, 1, 1):
            page(at(1, FrameCaptured(object())))
            page(at(1, frame_searched()))
        assert page.problem == (
            "the page is incomplete: TypeError: replace() should be called on dataclass instances"
        )
    finally:
        page.finish()
