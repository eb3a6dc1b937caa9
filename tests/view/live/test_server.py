"""Server of the live page: who may come, what it serves, and what it takes."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import aiohttp
import pytest
from aiohttp import web
from aiohttp.test_utils import make_mocked_request
from events import at, run_started

from executive.cell.visuals import Shape
from executive.geometry import Pose
from executive.view.live import live_scene
from executive.view.live.messages import PageChange, PageCommand
from executive.view.live.page_state import PageState
from executive.view.live.scene_proxy import SceneProxy
from executive.view.live.server import (
    CONTENT_POLICY,
    SECURITY_HEADERS,
    Server,
    find_access_error,
    parse_command,
)

TOKEN = "a-token"
HOST = "127.0.0.1:8123"
NO_TOKEN = "the address lacks the token of this run; copy the address from the terminal of the run"
OTHER_PAGE = "another page may neither read nor control this run"


PATHS = ("/", "", "*", "/another/", "/a-toke/", "/a-token2/", "//a-token/", "/A-TOKEN/", "/live", "/%ff/")
ORIGINS = (
    "http://evil.example",
    "null",
    "",
    f"https://{HOST}",
    "http://127.0.0.1:8124",
    f"http://{HOST}.evil",
)
NAMES = ("evil.example", "localhost:8123", "127.0.0.1", f"{HOST}.evil")


@pytest.mark.parametrize(
    ("path", "headers", "said"),
    [
        (f"/{TOKEN}/", {}, ""),
        (f"/{TOKEN}/", {"Origin": f"http://{HOST}", "Upgrade": "websocket"}, ""),
        *((path, {}, NO_TOKEN) for path in PATHS),
        *((f"/{TOKEN}/", {"Origin": origin}, OTHER_PAGE) for origin in ORIGINS),
        (f"/{TOKEN}/", {"Upgrade": "WebSocket"}, "a WebSocket request must contain the origin of its page"),
        *(
            (f"/{TOKEN}/", {"Host": name}, "the page must be opened by the address of this machine")
            for name in NAMES
        ),
    ],
)
def test_only_the_page_itself_is_let_in_and_only_with_the_token(path: str, headers: dict, said: str) -> None:
    request = make_mocked_request("GET", path, headers={"Host": HOST} | headers)
    assert find_access_error(request, TOKEN, HOST) == said


@dataclass
class Site:
    """A server at work, and a browser's connection to it."""

    server: Server
    session: aiohttp.ClientSession
    address: str
    page_state: PageState
    wishes: list[PageCommand]


def serve(do: Callable[[Site], Awaitable[None]]) -> None:
    """Serve a page while something is done with it."""

    async def work() -> None:
        wishes: list[PageCommand] = []
        listener = socket.create_server(("127.0.0.1", 0))
        port, page_state = listener.getsockname()[1], PageState()
        server = Server(page_state, SceneProxy(Path("nowhere")), wishes.append, TOKEN, port)
        runner = web.AppRunner(server.app)
        await runner.setup()
        await web.SockSite(runner, listener).start()
        async with aiohttp.ClientSession() as session:
            await do(Site(server, session, f"http://127.0.0.1:{port}", page_state, wishes))
        await runner.cleanup()

    asyncio.run(work())


def test_serves_the_page_to_the_page_and_nothing_else() -> None:
    async def get(site: Site, path: str) -> tuple[int, str, dict[str, str]]:
        async with site.session.get(f"{site.address}{path}") as answer:
            return answer.status, await answer.text(), dict(answer.headers)

    async def look(site: Site) -> None:
        for file, kind in (
            ("", "text/html"), ("page.js", "text/javascript"), ("page.css", "text/css"),
            ("colours.css", "text/css"),
        ):  # fmt: skip
            status, text, headers = await get(site, f"/{TOKEN}/{file}")
            assert (status, headers["Content-Type"]) == (200, f"{kind}; charset=utf-8")
            assert text
            assert headers.items() >= (SECURITY_HEADERS | {"Content-Security-Policy": CONTENT_POLICY}).items()
        for path in ("page.py", "../guard.py", "%2e%2e/guard.py", "live_scene.py"):
            status, text, _ = await get(site, f"/{TOKEN}/{path}")
            assert (status, text) in [(404, "there is no such file\n"), (403, text)]
        for path in ("/", "/live", "/scene", "/wrong/", "/wrong/live", "/wrong/scene/"):
            status, text, headers = await get(site, path)
            assert (status, text) == (403, f"{NO_TOKEN}\n")
            assert headers.items() >= SECURITY_HEADERS.items()
        for path in ("live", "scene"):
            for origin in ({}, {"Origin": "http://evil.example"}, {"Origin": "null"}):
                with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
                    await site.session.ws_connect(f"{site.address}/{TOKEN}/{path}", headers=origin)
                assert refused.value.status == 403
        assert site.wishes == []

    serve(look)
    assert CONTENT_POLICY.startswith("default-src 'none'; script-src 'self'; ")
    assert "frame-ancestors 'none'" in CONTENT_POLICY
    assert (SECURITY_HEADERS["Referrer-Policy"], SECURITY_HEADERS["Cache-Control"]) == (
        "no-referrer",
        "no-store",
    )


def test_a_watcher_receives_the_state_then_changes_and_may_send_commands() -> None:
    async def look(site: Site) -> None:
        site.page_state.apply(at(0, run_started(mission="sort", seed=3)))
        origin = {"Origin": site.address}
        async with site.session.ws_connect(f"{site.address}/{TOKEN}/live", headers=origin) as socket:
            assert (await socket.receive_json())["run"] == {"mission": "sort", "seed": 3}
            assert site.wishes == [PageCommand("browsers", browser_count=1)]
            site.page_state.take_changes()
            site.page_state.apply(PageChange(is_paused=True))
            await site.server.send_changes()
            assert await socket.receive_json() == {"is_paused": True}
            wishes = (
                '{"name": "render_on_cpu"}',
                '{"name": "pause"}',
                "rubbish",
                '{"name": "request", "text": "cube"}',
            )
            for said in (*wishes, '{"name": "fly"}', '{"name": "stop"}'):
                await socket.send_str(said)
            while site.wishes[-1] != PageCommand("stop"):
                await asyncio.sleep(0)
            site.page_state.apply(PageChange(note="over"))
            await site.server.close()
            assert await socket.receive_json() == {"note": "over"}
            assert (await socket.receive()).type is aiohttp.WSMsgType.CLOSE
        while site.wishes[-1] != PageCommand("browsers"):
            await asyncio.sleep(0)
        assert site.wishes[1] == PageCommand("browsers", browser_count=1, is_cpu_rendering=True)
        assert site.wishes[2:-1] == [
            PageCommand("pause"),
            PageCommand("request", "cube"),
            PageCommand("stop"),
        ]

    serve(look)


@pytest.mark.parametrize(
    ("text", "wish"),
    [
        ("", None), ("[]", None), ("null", None), ('"pause"', None), ("{", None), ('{"name": null}', None),
        ('{"name": "watchers", "by": 7}', None), ('{"name": ["pause"]}', None), ('{"name": "request"}', None),
        ('{"name": "request", "text": 3}', None), ('{"name": "stop", "text": "x"}', PageCommand("stop")),
    ],
)  # fmt: skip
def test_wishes_that_nobody_can_have_are_dropped(text: str, wish: object) -> None:
    assert parse_command(text) == wish


BOX = Shape("", "box", (0.1, 0.1, 0.1), Pose.identity(), (1.0, 0.0, 0.0))
PLACE = (0.5, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0)


class Built:
    """Stand-in for a scene that records its calls."""

    made: ClassVar[list[Built]] = []

    def __init__(self, path: Path, shapes: object) -> None:
        self.received: list[object] = [path, shapes]
        self.made.append(self)

    def set_body_poses(self, bodies: object) -> None:
        self.received.append(bodies)


@pytest.mark.parametrize("looked_at", [True, False])
def test_the_scene_is_built_once_when_somebody_looks_and_there_is_one(monkeypatch, looked_at) -> None:
    monkeypatch.setattr(Built, "made", [])
    monkeypatch.setattr(live_scene, "LiveScene", Built)

    async def work() -> None:
        scene_proxy = SceneProxy(Path("socket"))
        early = asyncio.create_task(scene_proxy.open_session()) if looked_at else None
        await asyncio.sleep(0.02)
        assert not Built.made
        scene_proxy.set_shapes((BOX,))
        scene_proxy.set_body_poses({"tool": PLACE})
        if early is not None:
            for session in (await early, await scene_proxy.open_session()):
                await session.close()
            scene_proxy.set_body_poses({})

    asyncio.run(work())
    assert [one.received for one in Built.made] == [[Path("socket"), (BOX,), {"tool": PLACE}, {}]] * looked_at
