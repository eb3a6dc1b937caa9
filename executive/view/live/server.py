"""Server of the live page: who may come, what it serves, and what it takes."""

from __future__ import annotations

import asyncio
import contextlib
import json
import secrets
from collections.abc import Awaitable, Callable
from importlib.resources import files

from aiohttp import WSMsgType, web

from executive.view.live.board import Board
from executive.view.live.messages import Wish
from executive.view.live.tunnel import Tunnel

PERIOD = 1 / 8
"""Time between two messages to the browsers [s]."""
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
    "connect-src 'self'; frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = {
    # The token is in the address: it must not leave with a link, nor stay in a cache.
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "SAMEORIGIN",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}
SHUTDOWN_TIMEOUT = 0.5
"""Longest wait for the browsers to take in the last news [s]."""
WISHES = ("pause", "resume", "step", "stop", "spare")
MAX_MESSAGE = 4096
"""Largest message of a browser [bytes]."""
_FILES = {
    "": ("live/page.html", "text/html"),
    "page.js": ("live/page.js", "text/javascript"),
    "page.css": ("live/page.css", "text/css"),
    "colours.css": ("colours.css", "text/css"),
}

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Server:
    """Serves the page to whoever knows its token and comes from the page itself.

    Args:
        board: State of the page.
        tunnel: Leads to the scene.
        wish: Takes what a person wants of the run, and how many watch.
        token: First part of every address.
        port: The server's.
    """

    def __init__(
        self, board: Board, tunnel: Tunnel, wish: Callable[[Wish], None], token: str, port: int
    ) -> None:
        self._board = board
        self._wish = wish
        self._token = token
        # By no other name: what answers to `localhost` may be another server, at [::1].
        self._host = f"127.0.0.1:{port}"
        self._watchers: dict[web.WebSocketResponse, bool] = {}
        self.app = web.Application(middlewares=[self._guarded])
        self.app.router.add_get("/{token}/live", self._live)
        self.app.router.add_get("/{token}/scene", tunnel.socket)
        self.app.router.add_get("/{token}/scene/{file:.*}", tunnel.page)
        self.app.router.add_get("/{token}/{file:.*}", self._file)

    @web.middleware
    async def _guarded(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Stand before every handler: refuse every request that is not of the page itself."""
        if problem := refusal(request, self._token, self._host):
            raise web.HTTPForbidden(text=f"{problem}\n", headers=HEADERS)
        response = await handler(request)
        if not response.prepared:
            for key, value in HEADERS.items():
                response.headers.setdefault(key, value)
        return response

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
            await asyncio.wait(closing, timeout=SHUTDOWN_TIMEOUT)

    async def _file(self, request: web.Request) -> web.Response:
        name = request.match_info["file"]
        if name not in _FILES:
            raise web.HTTPNotFound(text="there is no such thing here\n")
        file, kind = _FILES[name]
        text = files("executive.view").joinpath(file).read_text(encoding="utf-8")
        return web.Response(text=text, content_type=kind, headers={"Content-Security-Policy": POLICY})

    async def _live(self, request: web.Request) -> web.WebSocketResponse:
        """Show a watcher everything, then the news; take what they want."""
        socket = web.WebSocketResponse(max_msg_size=MAX_MESSAGE, heartbeat=10)
        await socket.prepare(request)
        await socket.send_str(json.dumps(self._board.everything))
        self._watchers[socket] = False
        self._tell_watched()
        try:
            async for message in socket:
                wish = understood(message.data) if message.type is WSMsgType.TEXT else None
                if wish is not None and wish.do == "spare":
                    self._watchers[socket] = True
                    self._tell_watched()
                elif wish is not None:
                    self._wish(wish)
        finally:
            del self._watchers[socket]
            self._tell_watched()
        return socket

    def _tell_watched(self) -> None:
        """Tell the run how many watch, and whether it should be sparing with one of them."""
        sparing = any(self._watchers.values())
        self._wish(Wish("watched", watchers=len(self._watchers), is_sparing=sparing))


def refusal(request: web.Request, token: str, host: str) -> str:
    """Return why a request is refused by the server with this token at this host, or ""."""
    # A name that leads here is not enough: a foreign site may let its own name lead to this machine.
    if request.headers.get("Host") != host:
        return "this page goes by the address of this machine only"
    given, _, _ = request.path.removeprefix("/").partition("/")
    if not secrets.compare_digest(given.encode(errors="replace"), token.encode()):
        return "the address lacks the token of this run; take it from the terminal that the run is in"
    origin = request.headers.get("Origin")
    if origin is not None and origin != f"http://{host}":
        return "another page may neither see nor command this run"
    # Browsers say so for every socket that a page opens.
    if origin is None and request.headers.get("Upgrade", "").lower() == "websocket":
        return "a connection must say which page it is of"
    return ""


def understood(text: str) -> Wish | None:
    """Return the wish in a message of a browser, or None if the message is invalid."""
    try:
        wish = json.loads(text)
    except ValueError:
        return None
    if not isinstance(wish, dict):
        return None
    if wish.get("do") in WISHES:
        return Wish(wish["do"])
    if wish.get("do") == "request" and isinstance(wish.get("word"), str):
        return Wish("request", wish["word"])
    return None
