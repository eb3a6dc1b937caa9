"""The live page of a run on the fake cell: what it shows, what it does, and where it listens."""

from __future__ import annotations

import asyncio
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import aiohttp
import pytest
from events import at

from executive.behaviours import load_skills
from executive.cell.frame import FrameCaptured
from executive.mission.load import load_mission
from executive.record.result import Result
from executive.run.assembly import RunOptions, assemble
from executive.run.run import Run
from executive.testing.fake_cell import FakeCell
from executive.view.live_page import LivePage
from tests.record.conftest import MISSION

RESULT = Result(mission="sort", seed=3, status="SUCCESS", reason="", message="", node="", run="runs/x")


@pytest.fixture
def page() -> Iterator[LivePage]:
    page = LivePage()
    yield page
    page.finish()


@pytest.fixture(params=["Release"])
def run(page: LivePage, tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Run]:
    """A run that is shown on the page; the param contains its last skills."""
    file = tmp_path / "mission.yaml"
    file.write_text(MISSION.replace("Release", request.param))
    options = RunOptions(3, has_keyboard=False, is_realtime=True, make_cell=FakeCell)
    with closing(assemble(load_mission(file, load_skills()), options, [page])) as run:
        page.open(run)
        yield run
        run.control.stop()


def find_server() -> str:
    """Return the number of the process that serves the page of the test, once it runs."""
    children = Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
    (server,) = (one for one in children if "view.live_server" in Path(f"/proc/{one}/cmdline").read_text())
    return server


@pytest.mark.slow
@pytest.mark.parametrize("run", ["Release, AwaitRequest"], indirect=True)
def test_a_browser_shows_and_controls_a_run_up_to_its_result(page: LivePage, run: Run) -> None:
    statuses: list[str] = []
    thread = threading.Thread(target=lambda: statuses.append(run.execute().status), daemon=True)
    shown: dict[str, Any] = {"nodes": {}, "items": {}}

    async def visit() -> None:
        origin = page.address.rsplit("/", 2)[0]
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(f"{page.address}live", headers={"Origin": origin}) as socket,
        ):

            async def wait_until(is_shown: Callable[[], Any]) -> None:
                while not is_shown():
                    changes = await socket.receive_json(timeout=20)
                    for key in ("nodes", "items"):
                        shown[key] |= changes.pop(key, {})
                    shown.update(changes)

            await wait_until(lambda: "tree" in shown)
            thread.start()
            await socket.send_json({"name": "step"})
            await wait_until(lambda: shown.get("clock", 0.0) > 0.0)
            assert run.tick == 1
            await socket.send_json({"name": "resume"})
            await wait_until(lambda: shown.get("choices"))
            assert shown["choices"] == ["cube", "sphere", "duck"]
            for text in ("a unicorn", "sphere"):
                await socket.send_json({"name": "request", "text": text})
            await wait_until(lambda: shown.get("has_ended"))
            page.finish(RESULT, "runs/x/report.html")
            await wait_until(lambda: "result" in shown)

    run.control.pause()
    asyncio.run(visit())
    thread.join()
    assert statuses == ["SUCCESS"]
    assert 'class="behaviour-tree"' in shown["tree"]
    assert shown["nodes"]["tree/Release"]["status"] == "success"
    assert shown["run"] == {"mission": "bring_one", "seed": 3}
    assert "placed" in {item["state"] for item in shown["items"].values()}
    assert shown["look"]["source"].startswith("data:image/jpeg;base64,")
    assert shown["result"]["report"] == "runs/x/report.html"


@pytest.mark.slow
def test_a_run_goes_on_without_its_page(page: LivePage, run: Run) -> None:
    os.kill(int(find_server()), signal.SIGKILL)
    assert run.execute().status == "SUCCESS"
    page.finish(RESULT)
    assert page.problem == "the page ended before the run: exit status -9"


def test_an_error_of_the_page_is_reported_and_not_raised(page: LivePage) -> None:
    page(at(1, FrameCaptured(object())))
    assert page.problem.startswith("the page is incomplete: TypeError: ")
