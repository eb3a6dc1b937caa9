"""The live page's server: what it serves, to whom, and what it takes from them."""

from __future__ import annotations

import asyncio
import json
import socket
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import aiohttp
import pytest
from aiohttp import web

from executive.view.live.board import Board
from executive.view.live.guard import Guard
from executive.view.live.server import Server, understood
from executive.view.live.tunnel import Tunnel

TOKEN = "a-token"


class Site:
    """A server at work, and a browser's connection to it."""

    def __init__(self, server: Server, session: aiohttp.ClientSession, address: str, board: Board) -> None:
        self.server, self.session, self.address, self.board = server, session, address, board
        self.wishes: list[dict[str, Any]] = []

    @property
    def origin(self) -> dict[str, str]:
        return {"Origin": self.address}

    async def get(self, path: str, **headers: str) -> tuple[int, str, dict[str, str]]:
        async with self.session.get(f"{self.address}{path}", headers=headers) as answer:
            return answer.status, await answer.text(), dict(answer.headers)


def serve(do: Callable[[Site], Awaitable[None]]) -> None:
    """Serve a page while something is done with it."""

    async def nowhere() -> Path:
        raise AssertionError("nobody may get as far as the scene")

    async def work() -> None:
        wishes: list[dict[str, Any]] = []
        listener = socket.create_server(("127.0.0.1", 0))
        port = listener.getsockname()[1]
        board = Board()
        server = Server(board, Guard(TOKEN, port), Tunnel(nowhere), lambda wish: wishes.append(dict(wish)))
        runner = web.AppRunner(server.app)
        await runner.setup()
        await web.SockSite(runner, listener).start()
        async with aiohttp.ClientSession() as session:
            site = Site(server, session, f"http://127.0.0.1:{port}", board)
            site.wishes = wishes
            await do(site)
        await runner.cleanup()

    asyncio.run(work())


def test_serves_the_page_and_nothing_else() -> None:
    async def look(site: Site) -> None:
        for file, kind in (
            ("", "text/html"),
            ("page.js", "text/javascript"),
            ("page.css", "text/css"),
            ("colours.css", "text/css"),
        ):
            status, text, headers = await site.get(f"/{TOKEN}/{file}")
            assert (status, headers["Content-Type"]) == (200, f"{kind}; charset=utf-8")
            assert text
            assert headers["Referrer-Policy"] == "no-referrer"
            assert headers["Cache-Control"] == "no-store"
            assert "default-src 'none'" in headers["Content-Security-Policy"]
        for path in ("page.py", "../guard.py", "%2e%2e/guard.py", "scene.py"):
            status, text, _ = await site.get(f"/{TOKEN}/{path}")
            assert (status, text) in [(404, "there is no such thing here\n"), (403, text)]

    serve(look)


@pytest.mark.parametrize("path", ["/", "/live", "/scene", "/wrong/", "/wrong/live", "/wrong/scene/"])
def test_refuses_whoever_lacks_the_token(path: str) -> None:
    async def look(site: Site) -> None:
        status, text, headers = await site.get(path)
        assert status == 403
        assert text.startswith("the address lacks the token of this run")
        assert headers["Referrer-Policy"] == "no-referrer"

    serve(look)


@pytest.mark.parametrize("path", ["live", "scene"])
@pytest.mark.parametrize("origin", [None, "http://evil.example", "null"])
def test_refuses_the_sockets_of_other_pages(path: str, origin: str | None) -> None:
    async def look(site: Site) -> None:
        headers = {} if origin is None else {"Origin": origin}
        with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
            await site.session.ws_connect(f"{site.address}/{TOKEN}/{path}", headers=headers)
        assert refused.value.status == 403
        assert site.wishes == []

    serve(look)


def test_a_watcher_is_told_everything_then_news_and_is_heard() -> None:
    async def look(site: Site) -> None:
        site.board.take(("run", {"clock": 0.0, "mission": "sort", "seed": 3}))
        async with site.session.ws_connect(f"{site.address}/{TOKEN}/live", headers=site.origin) as socket:
            assert (await socket.receive_json())["run"] == {"mission": "sort", "seed": 3}
            assert site.wishes == [{"do": "watched", "by": 1, "sparing": False}]
            site.board.news()
            site.board.take(("paused", {"paused": True}))
            await site.server.tell()
            assert await socket.receive_json() == {"paused": True}
            for said in (
                '{"do": "spare"}',
                '{"do": "pause"}',
                "rubbish",
                '{"do": "request", "word": "cube"}',
                '{"do": "fly"}',
            ):
                await socket.send_str(said)
            await socket.send_str('{"do": "stop"}')
            while site.wishes[-1] != {"do": "stop"}:
                await asyncio.sleep(0)
            site.board.take(("end", {"clock": 1.0}))
            await site.server.end()
            assert (await socket.receive_json())["over"] is True
            assert (await socket.receive()).type is aiohttp.WSMsgType.CLOSE
        while site.wishes[-1] != {"do": "watched", "by": 0, "sparing": False}:
            await asyncio.sleep(0)
        assert site.wishes[1] == {"do": "watched", "by": 1, "sparing": True}
        assert site.wishes[2:-1] == [{"do": "pause"}, {"do": "request", "word": "cube"}, {"do": "stop"}]

    serve(look)


@pytest.mark.parametrize(
    "text",
    ["", "[]", "null", '"pause"', '{"do": "watched", "by": 7}', '{"do": ["pause"]}', '{"do": "request"}',
     '{"do": "request", "word": 3}', "{", json.dumps({"do": None})],
)  # fmt: skip
def test_what_nobody_can_want_is_not_heard(text: str) -> None:
    assert understood(text) is None


def test_more_than_a_wish_is_dropped() -> None:
    assert understood('{"do": "stop", "word": "x", "by": 2}') == {"do": "stop"}
