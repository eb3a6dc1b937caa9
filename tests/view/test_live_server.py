"""Server of the live page: who may come, what it serves, and what it takes."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path

import aiohttp
import pytest
from aiohttp import web
from aiohttp.test_utils import make_mocked_request
from events import at, run_started

from executive.view.live_page import PageChange, PageCommand, PageState
from executive.view.live_server import (
    CONTENT_POLICY,
    SECURITY_HEADERS,
    SceneProxy,
    Server,
    find_access_error,
    parse_command,
)

TOKEN = "a-token"
HOST = "127.0.0.1:8123"


@pytest.mark.parametrize(
    ("path", "headers", "problem"),
    [
        (f"/{TOKEN}/", {}, ""),
        (f"/{TOKEN}/", {"Origin": f"http://{HOST}", "Upgrade": "websocket"}, ""),
        *((path, {}, "lacks the token") for path in ("/", "", "/a-toke/", "/a-token2/", "//a-token/")),
        *((f"/{TOKEN}/", {"Origin": origin}, "another page")
          for origin in ("http://evil.example", "null", "", f"https://{HOST}", f"http://{HOST}.evil")),
        (f"/{TOKEN}/", {"Upgrade": "WebSocket"}, "must contain the origin"),
        *((f"/{TOKEN}/", {"Host": name}, "by the address of this machine")
          for name in ("evil.example", "localhost:8123", "127.0.0.1", f"{HOST}.evil")),
    ],
)  # fmt: skip
def test_only_the_page_with_the_token_has_access(path: str, headers: dict[str, str], problem: str) -> None:
    request = make_mocked_request("GET", path, headers={"Host": HOST} | headers)
    found = find_access_error(request, TOKEN, HOST)
    assert (problem in found, bool(found)) == (True, bool(problem))


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


def test_the_server_serves_the_page_and_nothing_else() -> None:
    async def get(site: Site, path: str) -> tuple[int, str, dict[str, str]]:
        async with site.session.get(f"{site.address}{path}") as answer:
            return answer.status, await answer.text(), dict(answer.headers)

    async def visit(site: Site) -> None:
        for file, kind in (
            ("", "html"),
            ("page.js", "javascript"),
            ("page.css", "css"),
            ("colours.css", "css"),
        ):
            status, text, headers = await get(site, f"/{TOKEN}/{file}")
            assert (status, headers["Content-Type"]) == (200, f"text/{kind}; charset=utf-8")
            assert text
            assert headers.items() >= (SECURITY_HEADERS | {"Content-Security-Policy": CONTENT_POLICY}).items()
        for path in ("page.py", "../text.py", "%2e%2e/text.py"):
            assert (await get(site, f"/{TOKEN}/{path}"))[0] in (403, 404)
        for path in ("/", "/wrong/live", "/wrong/scene/"):
            status, _, headers = await get(site, path)
            assert (status, headers.items() >= SECURITY_HEADERS.items()) == (403, True)
        for path in ("live", "scene"):
            with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
                await site.session.ws_connect(f"{site.address}/{TOKEN}/{path}")
            assert refused.value.status == 403

    serve(visit)


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
            for text in ('{"name": "render_on_cpu"}', "rubbish", '{"name": "request", "text": "cube"}',
                         '{"name": "stop"}'):  # fmt: skip
                await socket.send_str(text)
            while site.wishes[-1] != PageCommand("stop"):
                await asyncio.sleep(0)
            site.page_state.apply(PageChange(note="over"))
            await site.server.close()
            assert await socket.receive_json() == {"note": "over"}
            assert (await socket.receive()).type is aiohttp.WSMsgType.CLOSE
        while site.wishes[-1] != PageCommand("browsers"):
            await asyncio.sleep(0)
        assert site.wishes[1] == PageCommand("browsers", browser_count=1, is_cpu_rendering=True)
        assert site.wishes[2:-1] == [PageCommand("request", "cube"), PageCommand("stop")]

    serve(look)


@pytest.mark.parametrize(
    ("text", "wish"),
    [
        ("", None), ("[]", None), ('{"name": "fly"}', None), ('{"name": "request", "text": 3}', None),
        ('{"name": "stop", "text": "x"}', PageCommand("stop")),
    ],
)  # fmt: skip
def test_invalid_commands_are_dropped(text: str, wish: object) -> None:
    assert parse_command(text) == wish
