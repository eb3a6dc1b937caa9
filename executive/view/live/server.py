"""The server of the live page: the page, what it shows, and what it wants."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Callable, Mapping
from importlib.resources import files
from typing import Any

from aiohttp import WSMsgType, web

from executive.view.live.board import Board
from executive.view.live.guard import Guard
from executive.view.live.tunnel import Tunnel

PERIOD = 1 / 8
"""Time between two messages to the browsers [s]."""
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
    "connect-src 'self'; frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
FAREWELL = 0.5
"""Longest wait for the browsers to take in the last news [s]."""
WISHES = ("pause", "resume", "step", "stop", "spare")
LONGEST = 4096
"""Of what a browser may say at once [bytes]."""
_FILES = {
    "": ("live/page.html", "text/html"),
    "page.js": ("live/page.js", "text/javascript"),
    "page.css": ("live/page.css", "text/css"),
    "colours.css": ("colours.css", "text/css"),
}

Wish = Callable[[Mapping[str, Any]], None]


class Server:
    """Serves the page to whoever the guard lets in.

    Args:
        board: What is shown.
        guard: Decides who may come.
        tunnel: Leads to the scene.
        wish: Takes what a person wants of the run, and how many watch.
    """

    def __init__(self, board: Board, guard: Guard, tunnel: Tunnel, wish: Wish) -> None:
        self._board = board
        self._wish = wish
        self._watchers: dict[web.WebSocketResponse, bool] = {}
        self.app = web.Application(middlewares=[guard.middleware()])
        self.app.router.add_get("/{token}/live", self._live)
        self.app.router.add_get("/{token}/scene", tunnel.socket)
        self.app.router.add_get("/{token}/scene/{file:.*}", tunnel.page)
        self.app.router.add_get("/{token}/{file:.*}", self._file)

    async def tell(self) -> None:
        """Tell the watchers what is new."""
        news = self._board.news()
        if news and self._watchers:
            text = json.dumps(news)
            for watcher in list(self._watchers):
                with contextlib.suppress(ConnectionError):
                    await watcher.send_str(text)

    async def keep_telling(self) -> None:
        """Tell the watchers what is new, for ever."""
        while True:
            await asyncio.sleep(PERIOD)
            await self.tell()

    async def end(self) -> None:
        """Say the last news and good-bye."""
        await self.tell()
        closing = [asyncio.create_task(watcher.close()) for watcher in self._watchers]
        if closing:
            await asyncio.wait(closing, timeout=FAREWELL)

    async def _file(self, request: web.Request) -> web.Response:
        name = request.match_info["file"]
        if name not in _FILES:
            raise web.HTTPNotFound(text="there is no such thing here\n")
        file, kind = _FILES[name]
        text = files("executive.view").joinpath(file).read_text(encoding="utf-8")
        return web.Response(text=text, content_type=kind, headers={"Content-Security-Policy": POLICY})

    async def _live(self, request: web.Request) -> web.WebSocketResponse:
        """Show a watcher everything, then the news; take what they want."""
        socket = web.WebSocketResponse(max_msg_size=LONGEST, heartbeat=10)
        await socket.prepare(request)
        await socket.send_str(json.dumps(self._board.everything()))
        self._count(socket, sparing=False)
        try:
            async for message in socket:
                wish = understood(message.data) if message.type is WSMsgType.TEXT else None
                if wish == {"do": "spare"}:
                    self._count(socket, sparing=True)
                elif wish is not None:
                    self._wish(wish)
        finally:
            del self._watchers[socket]
            self._tell_watched()
        return socket

    def _count(self, watcher: web.WebSocketResponse, *, sparing: bool) -> None:
        """Count a watcher, and whether the run should be sparing with it."""
        self._watchers[watcher] = sparing
        self._tell_watched()

    def _tell_watched(self) -> None:
        sparing = any(self._watchers.values())
        self._wish({"do": "watched", "by": len(self._watchers), "sparing": sparing})


def understood(text: str) -> dict[str, Any] | None:
    """Return what a browser wants, or None for something that nobody can want."""
    try:
        wish = json.loads(text)
    except ValueError:
        return None
    if not isinstance(wish, dict):
        return None
    if wish.get("do") in WISHES:
        return {"do": wish["do"]}
    if wish.get("do") == "request" and isinstance(wish.get("word"), str):
        return {"do": "request", "word": wish["word"]}
    return None
